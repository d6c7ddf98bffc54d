"""SFDR of four interleaved converters of 500 MS/s, 14 bits and 0.1 ps of jitter: the samples as they come, each
converter corrected by itself, the bank that hybank makes of the calibrated spec without any option, and
least-squares taps from the true errors, which a user cannot know.

    python examples/interleaved_sfdr/sfdr.py [FOLDER]      needs numpy, and `hybank` in PATH
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

CHANNELS, RATE, BAND = 4, 2e9, 740e6
# The true errors. Only `simulate` and the least squares know them.
SKEWS = np.array([0.0, 24e-12, -18e-12, 13e-12])
GAINS = np.array([0.0, 0.01, -0.008, 0.006])
OFFSETS = np.array([0.0, 0.002, -0.0015, 0.001])
SPEC = """fast_rate = "2 GS/s"
ratio = 4
signal = { band = "740 MHz" }
target = { filter = { family = "butterworth", order = 2, cutoff = "1.5 GHz" } }
""" + "".join(f'[[channel]]\ndelay_samples = {3 - i}\nbits = 14\njitter = "0.1 ps"\n' for i in range(CHANNELS))
SIGNALS = {
    "one tone, 733.1 MHz": [733.1e6],
    "two tones": [611.3e6, 702.9e6],
    "15 tones": [(23.7 + 47.9 * k) * 1e6 for k in range(15)],
}


def hybank(*arguments):
    done = subprocess.run(["hybank", *map(str, arguments)], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"hybank {' '.join(map(str, arguments))}:\n{done.stderr}")
    return done.stdout


def simulated(folder, tones, seed):
    """Captures of tones that fill 0.9 of full scale together, a row per converter."""
    errors = [("--delay-error", SKEWS), ("--gain-error", GAINS), ("--offset", OFFSETS)]
    given = [part for name, values in errors for part in (name, ",".join(f"{value!r}" for value in values.tolist()))]
    hybank("simulate", "spec.toml", "--source", "tones:" + ",".join(f"{tone:.0f}Hz" for tone in tones), "--gain",
           0.9 / len(tones), "--samples", 1 << 17, "--bits", 14, "--jitter", "0.1ps", "--seed", seed, "-o", folder,
           "--to", "raw", "--force", *given)
    turns = np.stack([np.fromfile(f"{folder}/ch{i + 1}.f32", "<f4") for i in range(CHANNELS)], axis=1)
    turns.astype("<f4").tofile(f"{folder}/adc.f32")
    return turns.T.astype(float)


def wav(name):
    content = Path(name).read_bytes()
    return np.frombuffer(content[content.index(b"data") + 8 :], "<f4").astype(float)


def least_squares(delays, taps, latency):
    """The taps of each phase of least mean-square error, for a white signal in the band of rms 0.25 and the noise of
    14 bits and jitter: one row per converter."""
    share = BAND / RATE
    covariance = lambda t: np.sinc(2 * share * t)
    noise = (2.0**-13 / 0.25) ** 2 / 12 + (2 * np.pi * BAND * 0.1e-12) ** 2 / 3
    phases = []
    for p in range(CHANNELS):
        instants = (-CHANNELS * np.arange(-(-(taps - p) // CHANNELS))[None, :] - delays[:, None]).ravel()
        normal = covariance(instants[:, None] - instants[None, :]) + noise * np.eye(instants.size)
        phases.append(np.linalg.solve(normal, covariance(p - latency - instants)).reshape(CHANNELS, -1))
    return phases


def filtered(samples, taps):
    outputs = [sum(np.convolve(x, f)[: x.size] for x, f in zip(samples, phase)) for phase in taps]
    return np.stack(outputs, axis=1).ravel()


def own_correction(samples, skews, half=16):
    """Samples in turn, each moved by the skew of its converter with 32 taps that take the others for exact."""
    turns, shifts = samples.T.ravel(), np.arange(1 - half, half + 1)
    covariance = lambda t: np.sinc(2 * BAND / RATE * t)
    normal = covariance(shifts[:, None] - shifts[None, :]) + 1e-9 * np.eye(shifts.size)
    out = np.empty_like(turns)
    for i, skew in enumerate(skews):
        weights = np.linalg.solve(normal, covariance(skew - shifts))
        out[i::CHANNELS] = np.convolve(turns, weights[::-1])[half : half + turns.size][i::CHANNELS]
    return out


def sfdr(samples, tones):
    """The weakest tone over the strongest line beside the tones, in decibels."""
    settled = samples[2000 : 2000 + (1 << 16)]
    n = 2 * np.pi * np.arange(settled.size) / settled.size
    window = sum(a * np.cos(k * n) for k, a in enumerate([0.27105, -0.43329, 0.21812, -0.06592, 0.01081, -0.00077]))
    lines = np.abs(np.fft.rfft(settled * window))
    found = []
    for tone in tones:
        bin = round(tone / RATE * settled.size)
        found.append(lines[bin - 8 : bin + 9].max())
        lines[bin - 8 : bin + 9] = 0
    return 20 * np.log10(min(found) / lines[8:].max())


def main(folder):
    (folder / "spec.toml").write_text(SPEC)
    nominal = np.arange(CHANNELS - 1, -1, -1.0)
    training = [61.7e6 + 113.3e6 * k for k in range(6)]
    simulated("training", training, 1)
    hybank("calibrate", "spec.toml", "training/adc.f32", "--format", "f32le", "--interleaved", CHANNELS, "--tone",
           ",".join(f"{tone:.0f}Hz" for tone in training), "-o", "measured.toml", "--force")
    report = json.loads(hybank("design", "measured.toml", "-o", "bank.json", "--no-proof", "--json", "--force"))
    bank = json.loads(Path("bank.json").read_text())
    known = [bank["channels"][i] for i in range(CHANNELS)]
    delays = np.array([channel["delay"] for channel in known]) * RATE
    gains, offsets = ([channel.get(key, default) for channel in known] for key, default in (("gain", 1), ("offset", 0)))
    taps = least_squares(nominal + SKEWS * RATE, report["taps"], report["latency"])
    print(f"bank: method {report['method']}, {report['taps']} taps per channel, latency {report['latency']}\n")
    print("| signal | raw | own correction | hybank | least squares with true values |\n| --- | --- | --- | --- | --- |")
    worst = 0.0
    for seed, (name, tones) in enumerate(SIGNALS.items(), 2):
        samples = simulated("captures", tones, seed)
        hybank("fuse", "bank.json", "captures/adc.f32", "--format", "f32le", "--interleaved", CHANNELS, "-o",
               "fused.wav", "--bits", "32f", "--force")
        correct = (samples - np.array(offsets)[:, None]) / np.array(gains)[:, None]
        exact = (samples - OFFSETS[:, None]) / (1 + GAINS)[:, None]
        ways = [samples.T.ravel(), own_correction(correct, delays - nominal),
                wav("fused.wav"), filtered(exact, taps)]
        found = [sfdr(way, tones) for way in ways]
        worst = max(worst, found[3] - found[2])
        print(f"| {name} | " + " | ".join(f"{value:.1f}" for value in found) + " |")
    if worst > 3.0:
        raise SystemExit(f"the default lies {worst:.1f} dB below least squares")


if __name__ == "__main__":
    import os

    work = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
    work.mkdir(parents=True, exist_ok=True)
    os.chdir(work)
    main(work)
