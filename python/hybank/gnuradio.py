"""A block for GNU Radio: N streams of slow samples in, one stream M times as fast out.

Imported as ``hybank.gnuradio`` by the Python that GNU Radio is installed for.
"""

import numpy as np
from gnuradio import gr

from hybank._keywords import checked


class fuse(gr.interp_block):  # noqa: N801
    """A block with an input for each converter and one output, that of ``Bank.stream``.

    Its output is late by the latency of the stream, which it declares. A flow graph that starts again begins with
    silence.

    Parameters
    ----------
    bank : Bank
        A bank whose converters have one rate.
    dtype : {"f4", "c8"}
        Samples are ``float32`` or ``complex64``, inputs and output alike.
    algorithm : str
        As in ``Bank.stream``.

    Raises
    ------
    ValueError
        The converters have rates of their own.

    Examples
    --------
    >>> block = hb.gnuradio.fuse(bank, "c8")  # doctest: +SKIP
    >>> for i, source in enumerate(sources):  # doctest: +SKIP
    ...     graph.connect(source, (block, i))
    >>> graph.connect(block, sink)  # doctest: +SKIP
    """

    @checked
    def __init__(self, bank, dtype="f4", algorithm="auto"):
        kind = np.dtype(dtype)
        if max(bank.samples) > 1:
            raise ValueError("converters with rates of their own: streams of a block have one rate; use bank.stream")
        gr.interp_block.__init__(self, "hybank", [kind] * bank.channels, [kind], bank.ratio)
        self._stream = bank.stream(dtype=kind, algorithm=algorithm)
        self._ratio = bank.ratio
        # Calls of a few thousand frames: the cost of a call from Python is shared by many samples.
        self.set_min_output_buffer(16384 * bank.ratio)
        self.declare_sample_delay(self._stream.latency)

    def start(self):
        """A flow graph that starts again begins with silence before it."""
        self._stream.reset()
        return True

    def work(self, input_items, output_items):
        """As many frames as the output has room for."""
        y = output_items[0]
        frames = len(y) // self._ratio
        y[: frames * self._ratio] = self._stream.process(np.stack([x[:frames] for x in input_items]))
        return frames * self._ratio
