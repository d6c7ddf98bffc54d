"""Banks and measurements as figures and as tables."""

import html as _html


def _axes(ax, instead):
    if ax is not None:
        return ax
    try:
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise ImportError(f"plot needs matplotlib: pip install matplotlib; {instead} gives the numbers") from error
    return plt.subplots()[1]


def plot(bank, ax=None, picture="error"):
    """Draw a picture of a bank; returns the axes. The error has its bounds in the legend, where they cannot collide."""
    ax = _axes(ax, "Bank.error_response" if picture == "error" else "Bank.pictures")
    if picture != "error":
        return _picture(bank, ax, picture)
    frequency, gain = bank.error_response(512)
    ax.plot(frequency, gain, label="error")
    names = {
        "upper": "upper bound of gamma",
        "lower": "computed lower bound, this method and size",
        "noncausal": "computed lower bound, any bank",
    }
    for (name, label), style in zip(names.items(), ("-.", "--", ":")):
        level = getattr(bank.gamma, name)
        if level is not None:
            ax.axhline(level, linestyle=style, linewidth=1, color="gray", label=f"{label}: {level:.4g}")
    ax.set_xlabel("frequency modulo the slow rate, Hz")
    ax.set_ylabel("largest gain from the signal's source to the error")
    ax.set_ylim(bottom=0)
    ax.legend(fontsize="small")
    return ax


def _picture(bank, ax, name):
    pictures = bank.pictures()
    if name not in pictures:
        from hybank._hybank import HybankError

        raise HybankError(f"picture: {ascii(name)[:200]} is unknown; choose {', '.join(pictures)}")
    picture = pictures[name]
    for k, (label, x, y) in enumerate(picture["curves"]):
        if picture["are_stems"]:
            ax.stem(x, y, linefmt=f"C{k}-", markerfmt=f"C{k}.", basefmt=" ", label=label)
        else:
            ax.plot(x, y, label=label)
    for label, x in picture["guides"]:
        ax.axvline(x, linestyle=":", linewidth=1, color="gray")
        ax.text(x, 0.02, label, transform=ax.get_xaxis_transform(), rotation=90, ha="right", fontsize="small")
    ax.set_xscale("log" if picture["is_logarithmic"] else "linear")
    ax.set_title(picture["title"])
    ax.set_xlabel(picture["x_label"])
    ax.set_ylabel(picture["y_label"])
    ax.legend(fontsize="small")
    return ax


def spectrum(found, ax=None):
    """Draw the spectrum of a measurement with its largest spurs, or that of the error of a comparison."""
    ax = _axes(ax, "spectrum")
    frequency, level = found.spectrum
    ax.plot(frequency, level, linewidth=0.8, label="spectrum")
    # A colour per cause: a text beside each spur would cover others.
    shown = {}
    for spur in getattr(found, "spurs", [])[:12]:
        # None is nothing at all.
        if spur.level_dbc is not None:
            shown.setdefault(spur.cause, []).append((spur.frequency_hertz, spur.level_dbc))
    top = max((tone.level_dbfs for tone in getattr(found, "tones", [])), default=0.0)
    for cause, spurs in shown.items():
        ax.plot([one[0] for one in spurs], [one[1] + top for one in spurs], "o", fillstyle="none", label=cause)
    ax.set_xlabel("frequency, Hz")
    ax.set_ylabel("level, dB of full scale")
    ax.legend(fontsize="small")
    return ax


def _table(caption, rows):
    line = lambda cells: "".join(f"<td>{_html.escape(str(cell))}</td>" for cell in cells)  # noqa: E731
    body = "".join(f"<tr><th>{_html.escape(name)}</th>{line(cells)}</tr>" for name, *cells in rows)
    return f"<table><caption>{_html.escape(caption)}</caption>{body}</table>"


def html(bank):
    """The facts of a bank as a table for notebooks."""
    gamma = bank.gamma
    number = lambda value: "unknown" if value is None else f"{value:.6g}"  # noqa: E731
    return _table("hybank bank", [
        ("method", bank.method),
        ("channels, ratio", f"{bank.channels}, {bank.ratio}"),
        ("delays", ", ".join(f"{delay:.6g} s" for delay in bank.delays)),
        ("latency", f"{bank.latency} fast samples"),
        ("gamma", f"{number(gamma.upper)} ({'proven' if bank.proven else 'computed'})"),
        ("lower bound for this size (computed)", number(gamma.lower)),
        ("lower bound for any bank (computed)", number(gamma.noncausal)),
    ])


def measured(found):
    """The figures of a measurement as a table for notebooks."""
    tones = [
        ("tone", f"{tone.frequency_hertz.value:.6g}", "Hz", f"amplitude {tone.amplitude.value:.6g}") for tone in found.tones
    ]
    spurs = [
        ("spur", "none" if spur.level_dbc is None else f"{spur.level_dbc:.2f}", "dBc", f"{spur.frequency_hertz:.6g} Hz: {spur.cause}")
        for spur in found.spurs[:8]
    ]
    return _table("hybank measurement", [*tones, *found.figures, *spurs])
