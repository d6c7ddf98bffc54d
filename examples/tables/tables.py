#!/usr/bin/env python3
"""Tables of what `hybank` does with virtual converters, beside the usual ways.

    python3 examples/tables/tables.py [quad|four|if|rates ...]

Every step is a command of `hybank`, which must be in PATH; `--show` prints the commands. What this script does
itself: it writes codes in turn into one table as a capture board does, makes noise, and
computes the usual ways (usual.py). It needs numpy and scipy.
"""

import json
import os
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import usual

SHOW = "--show" in sys.argv


def hybank(*words, report=False):
    """Runs a command; gives its report."""
    words = ["hybank", *map(str, words)]
    if SHOW:
        print("$", shlex.join(words))
    done = subprocess.run(words + (["--json"] if report else []), capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{shlex.join(words)}\n{done.stderr}")
    return json.loads(done.stdout) if report else None


def wav(path):
    """Samples of a WAV file of 16-bit integers or 32-bit floats, full scale 1."""
    data = Path(path).read_bytes()
    kind = int.from_bytes(data[data.index(b"fmt ") + 8 :][:2], "little")
    bits = int.from_bytes(data[data.index(b"fmt ") + 22 :][:2], "little")
    at = data.index(b"data") + 4
    samples = data[at + 4 : at + 4 + int.from_bytes(data[at : at + 4], "little")]
    is_float = bits == 32 and kind != 1
    return np.frombuffer(samples, "<f4").astype(float) if is_float else np.frombuffer(samples, "<i2") / 32768.0


def channels(folder, count):
    """The captures of a folder as rows of one frame each."""
    return np.stack([wav(f"{folder}/ch{i + 1}.wav") for i in range(count)], axis=1)


def figures(samples, tone, rate, ways=4):
    """The worst interleaving spur and the SINAD by `hybank measure`, of a file or of samples."""
    if not isinstance(samples, str):
        np.save("out.npy", samples)
        samples = "out.npy"
    rate = [] if samples.endswith(".wav") else ["--rate", rate]
    found = hybank("measure", samples, "--tone", tone, "--interleaved", ways, "--skip", 400, *rate, report=True)
    return found


def spur(found):
    """The worst spur of interleaving, dBc."""
    own = ("offset", "gain_or_skew", "harmonic_image")
    levels = [s["level_dbc"] for s in found["spurs"] if s["causes"] and s["causes"][0]["kind"] in own]
    return max(levels)


def row(*cells):
    print("| " + " | ".join(map(str, cells)) + " |")


def head(*cells):
    row(*cells)
    row(*["---"] * len(cells))


def both(found):
    return f"{spur(found):.1f} dBc, {found['sinad_db']:.1f} dB"


# 1. Codes of 8 bits, one per line, of four converters that make 3 GS/s in turn; nine captures, two units.

QUAD = """fast_rate = "3 GS/s"
ratio = 4
full_scale = "8bits"
[target]
filter = { family = "butterworth", order = 2, cutoff = "2.2 GHz" }
[[channel]]
delay_samples = 3
[[channel]]
delay_samples = 2
[[channel]]
delay_samples = 1
[[channel]]
delay_samples = 0
[signal]
band = "1.4 GHz"
[design]
method = "fir"
taps = 64
"""
UNITS = [
    {"--delay-error": "1.9ps,-1.3ps,0.8ps,0", "--gain-error": "0.9%,-0.6%,0.4%,0",
     "--offset": "0.012,-0.007,0.004,-0.01"},
    {"--delay-error": "-2.6ps,0.7ps,1.8ps,0", "--gain-error": "-0.5%,1.1%,-0.8%,0",
     "--offset": "-0.009,0.011,0.003,0.006"},
]
NINE = [97.13, 241.57, 389.91, 533.77, 701.33, 853.19, 1011.67, 1187.41, 1361.83]


def quad():
    Path("quad.toml").write_text(QUAD)
    rate = 3e9
    print("\nWorst interleaving spur and SINAD of tones at 431 MHz and 1124 MHz that were not learnt from.\n")
    head("unit", "tone", "as captured", "spec of the drawing", "one capture", "nine captures",
         "numpy, nine: spline", "numpy, nine: delay filters")
    for unit, errors in enumerate(UNITS, 1):
        errors = [word for pair in errors.items() for word in pair]
        dice = np.random.default_rng(unit)

        def capture(name, tone, samples):
            phase = dice.uniform(0, 0.4)  # a part of a millisecond by which the tone began earlier
            hybank("simulate", "quad.toml", "--source", f"tones:{tone:.6f}MHz", "--gain", f"{dice.uniform(0.5, 0.95):.3f}",
                   "--samples", samples + int(1e4 * phase) // 4 * 4, *errors, "--bits", 8, "--noise", 5.2e-3,
                   "--seed", 100 * unit + int(tone), "--force", "-o", "cap")
            frames = channels("cap", 4)[-samples // 4 :]
            np.savetxt(name, np.round(frames.reshape(-1) * 128).astype(int), fmt="%d")
            return frames

        nine = [f"z{k}.csv" for k in range(9)]
        learnt = [(capture(name, tone, 32768), [tone * 1e6]) for name, tone in zip(nine, NINE)]
        known = usual.Errors(learnt, rate, 3)
        for name, captures in [("one", nine[4:5]), ("nine", nine)]:
            hybank("calibrate", "quad.toml", *captures, "--interleaved", 4, "--reference", 4, "-o", f"{name}.toml", "--force")
            hybank("design", f"{name}.toml", "-o", f"{name}.json", "--force")
        hybank("design", "quad.toml", "-o", "drawn.json", "--force")
        for tone in (431.37, 1123.61):
            held = capture("held.csv", tone, 262144)
            found = [figures(held.reshape(-1), f"{tone}MHz", rate)]
            for name in ("drawn", "one", "nine"):
                hybank("fuse", f"{name}.json", "held.csv", "--interleaved", 4, "-o", "y.wav", "--force")
                found.append(figures("y.wav", f"{tone}MHz", rate))
            found += [figures(way(known, held, rate), f"{tone}MHz", rate)
                      for way in (usual.spline, usual.delay_filters)]
            row(unit, f"{tone:.0f} MHz", *map(both, found))


# 2. Four converters of 250 MS/s and 12 bits after filters of 600 MHz, calibrated by five tones.

FOUR = """fast_rate = "1 GS/s"
ratio = 4
[target]
filter = {{ family = "butterworth", order = 2, cutoff = "600 MHz" }}
{channels}
[signal]
band = "400 MHz"
[design]
method = "fir"
taps = 64
"""


def four_spec(delays, cutoffs):
    each = ('[[channel]]\ndelay = "{} ns"\nfilter = {{ family = "butterworth", order = 2, cutoff = "{} MHz" }}\n')
    return FOUR.format(channels="".join(each.format(*pair) for pair in zip(delays, cutoffs)))


def four():
    Path("four.toml").write_text(four_spec([3, 2, 1, 0], [600] * 4))
    Path("true.toml").write_text(four_spec([3.003, 1.9972, 1.0025, 0], [606, 595, 603, 600]))
    rate, tones = 1e9, [37.1237, 161.3191, 211.7313, 333.3517, 388.9719]
    errors = ["--gain-error", "0.5%,-0.4%,0.3%,0", "--offset", "0.002,-0.001,0.0015,0", "--bits", 12,
              "--jitter", "100fs", "--samples", 262144, "--force"]
    files = lambda folder: [f"{folder}/ch{i}.wav" for i in (1, 2, 3, 4)]
    listed = ",".join(f"{tone}MHz" for tone in tones)
    hybank("simulate", "true.toml", "--source", f"tones:{listed}", "--gain", 0.19, "--seed", 7, *errors, "-o", "training")
    hybank("calibrate", "four.toml", *files("training"), "-o", "measured.toml", "--reference", 4, "--tone", listed,
           "--fit", "delay,gain,offset,cutoff", "--force")
    for name in ("four", "measured"):
        hybank("design", f"{name}.toml", "-o", f"{name}.json", "--force")
    known = usual.Errors([(channels("training", 4), [tone * 1e6 for tone in tones])], rate, 3)
    print("\nSFDR and SINAD of three tones; skews of 3 ps, cut-offs 1 % apart, 100 fs of jitter.\n")
    head("tone", "as captured", "spec of the drawing", "calibrated", "numpy: spline", "numpy: delay filters")
    shown = lambda found: f"{found['sfdr_db']:.1f} dBc, {found['sinad_db']:.1f} dB"
    for tone in ("62.1MHz", "183.1MHz", "392.1MHz"):
        hybank("simulate", "true.toml", "--source", f"tones:{tone}", "--gain", 0.9, "--seed", 8, *errors, "-o", "held")
        held = channels("held", 4)
        found = [figures(held.reshape(-1), tone, rate)]
        for name in ("four", "measured"):
            hybank("fuse", f"{name}.json", *files("held"), "-o", "y.wav", "--force")
            found.append(figures("y.wav", tone, rate))
        found += [figures(way(known, held, rate), tone, rate) for way in (usual.spline, usual.delay_filters)]
        row(tone.replace("MHz", " MHz"), *map(shown, found))


# 3. An intermediate frequency after a band-pass of order 4.

IF = """fast_rate = "1 GS/s"
ratio = 4
[target]
filter = { family = "butterworth", order = 4, band = ["600 MHz", "900 MHz"] }
[[channel]]
delay = "3 ns"
[[channel]]
delay = "2 ns"
[[channel]]
delay = "1 ns"
[[channel]]
delay = 0
[signal]
band = ["640 MHz", "860 MHz"]
[design]
method = "fir"
taps = 64
"""


def intermediate():
    Path("if.toml").write_text(IF)
    rate, tones = 1e9, [663.17, 741.93, 829.37]
    errors = ["--delay-error", "3ps,-2.8ps,2.5ps,0", "--gain-error", "0.5%,-0.4%,0.3%,0",
              "--offset", "0.002,-0.001,0.0015,0", "--bits", 12, "--samples", 262144, "--force"]
    files = lambda folder: [f"{folder}/ch{i}.wav" for i in (1, 2, 3, 4)]
    listed = ",".join(f"{tone}MHz" for tone in tones)
    hybank("simulate", "if.toml", "--source", f"tones:{listed}", "--gain", 0.3, "--seed", 3, *errors, "-o", "training")
    hybank("calibrate", "if.toml", *files("training"), "-o", "measured.toml", "--reference", 4, "--force")
    for name in ("if", "measured"):
        hybank("design", f"{name}.toml", "-o", f"{name}.json", "--force")
    known = usual.Errors([(channels("training", 4), [tone * 1e6 for tone in tones])], rate, 3)
    print("\nSFDR and SINAD of tones after a band-pass of order 4 from 600 to 900 MHz, without `--tone`.\n")
    head("tone", "as captured", "spec of the drawing", "calibrated", "numpy: gains and offsets")
    shown = lambda found: f"{found['sfdr_db']:.1f} dBc, {found['sinad_db']:.1f} dB"
    for tone in ("671.3MHz", "702.1MHz", "851.9MHz"):
        hybank("simulate", "if.toml", "--source", f"tones:{tone}", "--gain", 0.9, "--seed", 4, *errors, "-o", "held")
        held = channels("held", 4)
        found = [figures(held.reshape(-1), tone, rate)]
        for name in ("if", "measured"):
            hybank("fuse", f"{name}.json", *files("held"), "-o", "y.wav", "--force")
            found.append(figures("y.wav", tone, rate))
        found.append(figures(known.levelled(held), tone, rate))
        row(tone.replace("MHz", " MHz"), *map(shown, found))


# 4. Converters with rates of their own.

RATES = """fast_rate = "{fast}"
latency = {latency}
[target]
filter = {target}
[[channel]]
rate = "{rates[0]}"
delay_samples = {delays[0]}
filter = {first}
[[channel]]
rate = "{rates[1]}"
delay_samples = {delays[1]}
filter = {second}
[design]
method = "h2"
taps = {taps}
"""


def butterworth(order, cutoff):
    return f'{{ family = "butterworth", order = {order}, cutoff = "{cutoff}" }}'


AUDIO = dict(fast="48 kS/s", target=butterworth(4, "9 kHz"), rates=("24 kHz", "16 kHz"), delays=(4.3, 4.1),
             first=butterworth(4, "9 kHz"), second=butterworth(4, "7 kHz"), taps=48)
INERTIAL = dict(fast="300 S/s", target=butterworth(2, "20 Hz"), rates=("100 Hz", "60 Hz"), delays=(0.4, 1.7),
                first=butterworth(2, "20 Hz"), second=butterworth(2, "20 Hz"), taps=90)
# Root of the mean square of the error per fast sample for an input of unit density, from covariances alone
# (scipy, not this program): system, latency counted from the sampling instant, noise, rms.
GOLDEN = [
    (AUDIO, 5, 0, 0.0528751882), (AUDIO, 12, 0, 0.0470057306), (AUDIO, 20, 0, 0.0469987756),
    (AUDIO, 5, 1e-2, 0.0595395837), (AUDIO, 12, 1e-2, 0.0550370025), (AUDIO, 20, 1e-2, 0.0550324897),
    (INERTIAL, 20, 1e-3, 0.0460010907), (INERTIAL, 20, 1e-2, 0.0482508302),
]


def rates():
    print("\nRoot mean square of the error and noise, beside golden values from covariances alone.\n")
    head("system", "latency", "noise", "golden", "`hybank design`")
    for system, latency, noise, golden in GOLDEN:
        # The latency of a spec counts from the sampling instant of a whole frame.
        periods = [spec_rate(system["fast"]) / spec_rate(rate) for rate in system["rates"]]
        frame = np.lcm(*[int(period) for period in periods])
        wait = max(np.ceil(frame - period - delay) for period, delay in zip(periods, system["delays"]))
        text = RATES.format(latency=latency + int(wait), **system)
        Path("rates.toml").write_text(text + (f"noise = {noise}\n" if noise else ""))
        found = hybank("design", "rates.toml", "-o", "rates.json", "--force", report=True)
        rms = np.hypot(found["rms_error"], found["output_noise"])
        row(" and ".join(system["rates"]), latency, noise, f"{golden:.10f}", f"{rms:.10f}")

    print("\nWhite noise in the band, captured by virtual converters: SNR in dB.\n")
    head("system", "promised by `design`", "measured", "promised for a spline", "promised for the best converter")
    for example, band in (("inertial", 60.0), ("two-rates", 14000.0)):
        if example == "inertial":
            hybank("init", "--example", "inertial", "-o", "example.toml", "--force")
            rate, name = 300.0, "100 Hz and 60 Hz to 300 Hz"
        else:
            text = RATES.format(latency=40, **AUDIO).replace("[design]", '[signal]\nband = "14 kHz"\nrms = 0.25\n[design]\nnoise = 1e-4')
            Path("example.toml").write_text(text)
            rate, name = 48e3, "24 kHz and 16 kHz to 48 kHz"
        found = hybank("design", "example.toml", "-o", "example.json", "--force", report=True)
        # The rms of the signal is that at the output of the target, 0.25 in both specs.
        write_wav("noise.wav", band_noise(60_000, band / rate, 5), rate)
        record = ["simulate", "example.json", "--source", "noise.wav", "--samples", 60_000, "-o", "cap", "--force"]
        hybank(*record)
        gain = 0.25 / np.std(wav("cap/target.wav"))
        hybank(*record, "--gain", gain, "--noise", 1e-4)
        hybank("fuse", "example.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "y.wav", "--force")
        measured = hybank("measure", "y.wav", "--ref", "cap/target.wav", "--skip", 300, report=True)
        predicted = found["figures"]
        ratios = {way["way"]: way["snr_db"] for way in predicted["usual_ways"]}
        row(name, *(f"{x:.1f}" for x in (predicted["snr"]["total_db"], measured["reference"]["snr_db"],
                                         ratios.get("cubic-spline", np.nan), ratios["one-channel"])))


def spec_rate(text):
    number, unit = text.split()
    return float(number) * (1000 if unit[0] == "k" else 1)


def band_noise(count, share, seed):
    """White noise below `share` of the rate, periodic, of rms 1."""
    spectrum = np.fft.rfft(np.random.default_rng(seed).standard_normal(count))
    spectrum[int(share * count) :] = 0
    spectrum[0] = 0
    samples = np.fft.irfft(spectrum, count)
    return samples / np.std(samples)


def write_wav(path, samples, rate):
    """A mono WAV file of 32-bit floats."""
    data = np.asarray(samples, "<f4").tobytes()
    shape = np.array([1, int(rate), 4 * int(rate)], "<u4").tobytes()
    header = b"fmt " + (16).to_bytes(4, "little") + (3).to_bytes(2, "little") + (1).to_bytes(2, "little")
    header += shape[4:12] + (4).to_bytes(2, "little") + (32).to_bytes(2, "little")
    body = b"WAVE" + header + b"data" + len(data).to_bytes(4, "little") + data
    Path(path).write_bytes(b"RIFF" + len(body).to_bytes(4, "little") + body)


TABLES = {"quad": quad, "four": four, "if": intermediate, "rates": rates}


def main():
    wanted = [word for word in sys.argv[1:] if word != "--show"]
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for name in wanted or TABLES:
            TABLES[name]()


main()
