"""Two and more recorders at one event, merged by hybank and by the usual ways, judged by the exact signal.

    python3 examples/merge/scenes.py [NAME ..]      needs numpy, scipy, soundfile, and hybank on the path (or HYBANK)

Every scene has a signal whose spectrum ends, recorders with rates, clocks, polarities, noise and 16 bits of their
own, all seeded; sensors and loggers write tables with time stamps. What a recorder samples, and the truth, are
values of the same band-limited function.
"""
import json, os, subprocess, sys, tempfile
import numpy as np
import soundfile
from scipy.interpolate import CubicSpline

HYBANK = os.environ.get("HYBANK", "hybank")
MASTER = 192_000  # samples per second of the signal, at which it is oversampled


def values(x, rate, t, half=32, beta=12.0):
    """The function through samples x at the times t: sums of windowed sines, exact to -140 dB where x is oversampled."""
    place = t * rate
    nearest = np.floor(place).astype(int)
    part = place - nearest
    total = np.zeros(len(t))
    for k in range(-half + 1, half + 1):
        u = part - k
        window = np.i0(beta * np.sqrt(np.maximum(0, 1 - (u / half) ** 2))) / np.i0(beta)
        total += x[np.clip(nearest + k, 0, len(x) - 1)] * np.sinc(u) * window
    return total


def coloured(density, seconds, rng):
    n = int(seconds * MASTER)
    f = np.fft.rfftfreq(n, 1 / MASTER)
    return np.fft.irfft(np.fft.rfft(rng.standard_normal(n)) * density(f), n)


def signal(kind, seconds, seed, top):
    rng = np.random.default_rng(seed)
    n = int(seconds * MASTER)
    t = np.arange(n) / MASTER
    f = np.fft.rfftfreq(n, 1 / MASTER)
    ends = np.clip((top - f) / 600, 0, 1) * (f > 30)
    if kind == "noise":
        x = coloured(lambda f: ends, seconds, rng)
    elif kind == "music":
        x = np.zeros(n)
        for begin in np.arange(0, seconds, 0.25):
            pitch = 110 * 2 ** (rng.integers(0, 36) / 12)
            a = int(begin * MASTER)
            m = min(n - a, MASTER)
            tt = np.arange(m) / MASTER
            envelope = np.minimum(tt / 0.01, 1) * np.exp(-3 * tt) * np.minimum(1, (m / MASTER - tt) / 0.02)
            for harmonic in range(1, int((top - 700) / pitch)):
                decay = np.exp(-0.3 * harmonic * tt) / harmonic**0.9
                x[a : a + m] += envelope * decay * np.sin(2 * np.pi * pitch * harmonic * tt + 6 * rng.random())
        x += 0.02 * np.std(x) * coloured(lambda f: ends, seconds, rng) / 0.3
    else:  # like speech: falls steeply over the band, and comes and goes
        x = coloured(lambda f: ends / (1 + (f / 500) ** 2) / (1 + (f / 4000) ** 2), seconds, rng)
        knots = np.arange(0, seconds + 1, 0.12)
        x *= np.interp(t, knots, rng.random(len(knots)) ** 2 + 0.02)
    x = np.fft.irfft(np.fft.rfft(x) * ends, n)
    return 0.7 * x / np.max(np.abs(x))


class Recorder:
    def __init__(self, rate, start, ppm=0.0, gain=1.0, noise=3e-5, bend=0.0, jump=0.0, lost=None):
        self.rate, self.start, self.ppm, self.gain = rate, start, ppm, gain
        self.noise, self.bend, self.jump, self.lost = noise, bend, jump, lost

    def times(self, seconds):
        """When it samples; half-way its drift turns round with a bend, and falls by a jump."""
        t = np.arange(int(seconds * self.rate)) / self.rate
        t = self.start + t / (1 + 1e-6 * self.ppm) + 1e-6 * self.bend * t * (1 - t / seconds)
        t += 1e-6 * self.jump * np.maximum(0, t - self.start - seconds / 2)
        return t if self.lost is None else np.delete(t, slice(*self.lost))

    def record(self, x, seconds, rng):
        t = self.times(seconds)
        y = self.gain * values(x, MASTER, t) + self.noise * rng.standard_normal(len(t))
        return t, np.round(y * 32768) / 32768


SCENES = {
    # name: kind, top of the band, recorders, rate of the result
    "music": ("music", 18e3, [Recorder(24_000, 1.5), Recorder(24_000, 0.2, 20, -0.6)], 48_000),
    "noise": ("noise", 18e3, [Recorder(24_000, 1.5), Recorder(24_000, 0.2, 20, -0.6)], 48_000),
    "speech": ("speech", 18e3, [Recorder(24_000, 1.5), Recorder(24_000, 0.2, 20, -0.6)], 48_000),
    "two rates": ("music", 20e3, [Recorder(44_100, 0.3), Recorder(48_000, 0.9, -15, 0.8)], 96_000),
    "dropout": ("speech", 18e3, [Recorder(24_000, 0.5), Recorder(24_000, 0.8, 8, lost=(120_000, 120_700))], 48_000),
    "three recorders": (
        "music", 20e3,
        [Recorder(24_000, 0.5), Recorder(24_000, 0.7, 12, 0.9), Recorder(24_000, 0.1, -31, -1.1)], 72_000,
    ),
    "noise, three": (
        "noise", 20e3,
        [Recorder(24_000, 0.5), Recorder(24_000, 0.7, 12, 0.9), Recorder(24_000, 0.1, -31, -1.1)], 72_000,
    ),
    "drift turns round": ("music", 18e3, [Recorder(24_000, 0.5), Recorder(24_000, 0.9, 0, 0.7, bend=40)], 48_000),
    "rate jumps": ("music", 18e3, [Recorder(24_000, 0.5), Recorder(24_000, 0.9, 20, 0.7, jump=30)], 48_000),
    "quiet recorder": ("speech", 10e3, [Recorder(24_000, 0.5), Recorder(24_000, 0.9, 25, 0.05)], 24_000),
}


class Sensor:
    """Values with time stamps, off its even clock by up to `jitter` seconds, which the stamps know."""

    def __init__(self, rate, ppm=0.0, noise=1e-4, jitter=0.0):
        self.rate, self.ppm, self.noise, self.jitter = rate, ppm, noise, jitter

    def write(self, path, tones, seconds, rng):
        t = np.arange(int(seconds * self.rate)) / self.rate / (1 + 1e-6 * self.ppm) + 0.01
        t += self.jitter * rng.uniform(-1, 1, len(t))
        y = tones(t) + self.noise * rng.standard_normal(len(t))
        np.savetxt(path, np.column_stack([t, y]), "%.9f", ",", header="time,x", comments="")
        return t, y


STAMPED = {
    # name: top of the band, sensors, rate of the result, seconds
    "three sensors": (90, [Sensor(100, 25, 1e-3), Sensor(125, -40, 2e-3), Sensor(80, 10, 5e-4)], 400, 120),
    "logger 100 us": (200, [Sensor(500, noise=1e-3, jitter=100e-6)], 500, 40),
    "logger 600 us": (200, [Sensor(500, noise=1e-3, jitter=600e-6)], 500, 40),
}


def run_stamped(name, folder):
    top, sensors, rate, seconds = STAMPED[name]
    rng = np.random.default_rng(5)
    lines = top * rng.random(200), 2 * np.pi * rng.random(200)

    def tones(t):
        """Of power 1 and of a spectrum that is flat over the band."""
        return 0.1 * sum(np.cos(2 * np.pi * f * t + phase) for f, phase in zip(*lines))

    files = [f"{folder}/{number}.csv" for number in range(len(sensors))]
    written = [sensor.write(file, tones, seconds, rng) for sensor, file in zip(sensors, files)]
    output = f"{folder}/merged.csv"
    command = [HYBANK, "merge", *files, "-o", output, "--rate", f"{rate}Hz", "--json", "--force", *sys.argv_extra]
    told = subprocess.run(command, capture_output=True, text=True)
    if told.returncode:
        return f"{name:18} {told.stderr.strip()}"
    t, merged = np.loadtxt(output, delimiter=",", skiprows=1).T
    truth, inner = tones(t), slice(len(t) // 20, -len(t) // 20)

    def snr(y):
        return 10 * np.log10(np.mean(truth[inner] ** 2) / np.mean((y[inner] - truth[inner]) ** 2))

    alone = [CubicSpline(*one)(t) for one in written]
    times, samples = map(np.concatenate, zip(*written))
    order = np.argsort(times)
    order = order[np.concatenate([[True], np.diff(times[order]) > 1e-4])]
    spline = CubicSpline(times[order], samples[order])(t)
    return row(name, snr(merged), told, snr(spline), max(map(snr, alone)), snr(np.mean(alone, axis=0)))


def row(name, merged, told, spline, best, mean):
    predicted = json.loads(told.stdout)["predicted_snr_db"]
    return (
        f"{name:18} merged {merged:5.1f} (predicted {predicted:5.1f})   spline {spline:5.1f}   "
        f"best recorder {best:5.1f}   mean {mean:5.1f}"
    )


def run(name, folder, seconds=float(os.environ.get("SECONDS_OF_SCENE", 16))):
    kind, top, recorders, rate = SCENES[name]
    x = signal(kind, seconds + 3, 3, top)
    rng = np.random.default_rng(9)
    times, samples, files = [], [], []
    for number, recorder in enumerate(recorders):
        t, y = recorder.record(x, seconds, rng)
        files.append(f"{folder}/{number}.wav")
        soundfile.write(files[-1], y, recorder.rate, subtype="PCM_16")
        times.append(t)
        samples.append(y / recorder.gain)
    output = f"{folder}/merged.wav"
    command = [HYBANK, "merge", *files, "-o", output, "--rate", f"{rate}Hz", "--json", "--force", *sys.argv_extra]
    told = subprocess.run(command, capture_output=True, text=True)
    if told.returncode:
        return f"{name:18} {told.stderr.strip()}"
    report = json.loads(told.stdout)
    merged, _ = soundfile.read(output)
    # The clock of the result is that of the first recorder.
    t = times[0][report["first_sample"]] + np.arange(len(merged)) / rate / (1 + 1e-6 * recorders[0].ppm)
    return judged(name, x, (times, samples), (t, merged), told)


def judged(name, x, recorded, result, told):
    """A row: the result at its instants beside what spline, best recorder and mean give there."""
    (times, samples), (t, merged) = recorded, result
    truth = values(x, MASTER, t)
    inner = slice(int(0.05 * len(t)), int(0.95 * len(t)))

    def snr(y):
        return 10 * np.log10(np.mean(truth[inner] ** 2) / np.mean((y[inner] - truth[inner]) ** 2))

    def even(number):
        """One recorder alone, by its true clock, as any resampler with a long window gives it."""
        place = np.interp(t, times[number], np.arange(len(times[number])))
        return values(samples[number], 1.0, place)

    together = np.concatenate(times)
    order = np.argsort(together)
    keep = np.concatenate([[True], np.diff(together[order]) > 1e-9])
    spline = CubicSpline(together[order][keep], np.concatenate(samples)[order][keep])(t)
    alone = [even(number) for number in range(len(times))]
    return row(name, snr(merged), told, snr(spline), max(map(snr, alone)), snr(np.mean(alone, axis=0)))


PILOT = 1_000.0
PILOT_SPEC = """
fast_rate = 48000
ratio = 2
latency = 20
target = {{ filter = {{ family = "butterworth", order = 2, cutoff = 22000 }} }}
signal = {{ band = 18000, rms = {rms} }}
channel = [{{ delay = 0, bits = 16, noise = 3e-5 }}, {{ delay = "18 us", bits = 16, noise = 3e-5 }}]
design = {{ method = "h2", taps = 48 }}
"""


def run_pilot(name, folder, seconds=float(os.environ.get("SECONDS_OF_SCENE", 16))):
    """Converters that are started together and drift apart: a tone below the signal tells by how much."""
    x = signal("music", seconds + 3, 3, 18e3)
    f = np.fft.rfftfreq(len(x), 1 / MASTER)
    x = np.fft.irfft(np.fft.rfft(x) * np.clip((f - 1800) / 400, 0, 1), len(x))
    x += 0.02 * np.cos(2 * np.pi * PILOT * np.arange(len(x)) / MASTER)
    rng = np.random.default_rng(9)
    recorders = [Recorder(24_000, 0.5), Recorder(24_000, 0.5 - 18e-6, 0.6)]
    recorded = [recorder.record(x, seconds, rng) for recorder in recorders]
    files = [f"{folder}/{number}.wav" for number in range(len(recorded))]
    for (_, y), file in zip(recorded, files):
        soundfile.write(file, y, 24_000, subtype="PCM_16")
    spec, bank, drift, output = (f"{folder}/{file}" for file in ("spec.toml", "bank.json", "drift.jsonl", "fast.wav"))
    with open(spec, "w") as file:
        file.write(PILOT_SPEC.format(rms=np.std(x)))
    inputs = [word for file in files for word in ("--input", file)]
    commands = {
        "pilot, stream": [["stream", bank, *inputs, "--format", "wav", "-o", output, "--pilot", f"{PILOT}Hz"]],
        "pilot, fuse": [
            ["calibrate", spec, *files, "-o", f"{folder}/measured.toml", "--tone", f"{PILOT}Hz", "--drift", drift],
            ["fuse", bank, *files, "-o", output, "--track", drift],
        ],
    }
    for command in [["design", spec, "-o", bank, "--no-proof"], *commands[name]]:
        told = subprocess.run([HYBANK, *command, "--json", "--force"], capture_output=True, text=True)
        if told.returncode:
            return f"{name:18} {told.stderr.strip()}"
    merged, rate = soundfile.read(output)
    t = recorded[0][0][0] + np.arange(len(merged)) / rate
    return judged(name, x, tuple(zip(*recorded)), (t, merged), told)


if __name__ == "__main__":
    sys.argv_extra = [a for a in sys.argv[1:] if a.startswith("--")]
    names = [a for a in sys.argv[1:] if not a.startswith("--")] or [*SCENES, "pilot, stream", "pilot, fuse", *STAMPED]
    print("SNR in dB; spline: cubic, through all samples at their true instants; the others by the true clocks")
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            how = run_stamped if name in STAMPED else run_pilot if name.startswith("pilot") else run
            print(how(name, folder), flush=True)
