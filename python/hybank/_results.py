"""Results as named values."""

import json
from types import SimpleNamespace


class Record(SimpleNamespace):
    """Named values, with the names that ``--json`` of the command line has."""

    def __getattr__(self, name):
        """Only for names that are not there."""
        raise AttributeError(f"{type(self).__name__} has no {name!r}, but {', '.join(vars(self))}")

    def __getitem__(self, name):
        return vars(self)[name]

    def __iter__(self):
        return iter(vars(self))

    def __len__(self):
        return len(vars(self))

    def keys(self):
        """The names, so that ``dict(record)`` makes a dictionary."""
        return vars(self).keys()


def record(text):
    """The records of a JSON text."""
    return json.loads(text, object_hook=lambda fields: Record(**fields))


def lines(readings):
    """Readings of delays, mappings or records, as JSON lines."""
    return "\n".join(json.dumps(dict(reading), default=_plain) for reading in readings)


def _plain(value):
    if isinstance(value, Record):
        return dict(value)
    return value.tolist()


class Comparison(Record):
    """A record against a reference: ``record[n] = gain * reference(n - lag) + offset + error``.

    ``lag_samples``, ``gain`` and ``offset`` have a ``value`` and its standard deviation ``sigma``; ``snr_db`` is that
    after they are taken out, ``snr_unaligned_db`` that sample by sample. ``spectrum`` is that of the error: hertz, dB of
    full scale.
    """

    def __repr__(self):
        return f"Comparison(snr_db={self.snr_db:.2f}, lag_samples={self.lag_samples.value:.6f}, gain={self.gain.value:.8f})"

    def plot(self, ax=None):
        """Draw the spectrum of the error with matplotlib.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure if left out.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import numpy as np
        >>> x = np.cos(0.3 * np.arange(4096))
        >>> ax = hb.measure(1.001 * x, 48e3, ref=x).plot()  # doctest: +SKIP
        """
        from hybank import _show

        return _show.spectrum(self, ax)
