"""A bank as a figure and as a table."""

import html as _html


def plot(bank, ax=None):
    """Draw the error by frequency with its bounds; returns the axes."""
    if ax is None:
        try:
            import matplotlib.pyplot as plt
        except ImportError as error:
            raise ImportError(
                "Bank.plot needs matplotlib: pip install matplotlib; Bank.error_response gives the numbers"
            ) from error
        _, ax = plt.subplots()
    frequency, gain = bank.error_response(512)
    ax.plot(frequency, gain, label="error")
    for name in ("upper", "lower", "noncausal"):
        level = getattr(bank.gamma, name)
        if level is not None:
            ax.axhline(level, linestyle=":", linewidth=1, color="gray")
            ax.annotate(name, (0, level), fontsize="small", va="bottom")
    ax.set_xlabel("frequency modulo the slow rate, Hz")
    ax.set_ylabel("largest gain from input to error")
    ax.set_ylim(bottom=0)
    return ax


def html(bank):
    """The facts of a bank as a table for notebooks."""
    gamma = bank.gamma
    number = lambda value: "unknown" if value is None else f"{value:.6g}"  # noqa: E731
    rows = {
        "method": bank.method,
        "channels, ratio": f"{bank.channels}, {bank.ratio}",
        "delays": ", ".join(f"{delay:.6g} s" for delay in bank.delays),
        "latency": f"{bank.latency} fast samples",
        "gamma": f"{number(gamma.upper)} ({'proven' if bank.proven else 'computed'})",
        "no bank of this size below": number(gamma.lower),
        "no bank at all below": number(gamma.noncausal),
    }
    cells = "".join(f"<tr><th>{_html.escape(k)}</th><td>{_html.escape(str(v))}</td></tr>" for k, v in rows.items())
    return f"<table><caption>hybank bank</caption>{cells}</table>"
