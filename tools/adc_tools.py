#!/usr/bin/env python3
"""Compares `hybank measure` with two public tools on records that the tools themselves make.

    pip install adctoolbox==0.9.1 python-adc-eval==0.4.0
    python3 tools/adc_tools.py            # writes tests/numerics/adc_records/*.wav and figures.json
    python3 tools/adc_tools.py HYBANK     # also runs this binary on them and prints their figures as a table

Run from the repository root. Made with adctoolbox 0.9.1, python-adc-eval 0.4.0 and numpy 2.4.6.

The records are WAV files of 32-bit floats; the tools read the same rounded samples as hybank does. All tones but
that of `off-bin` are coherent, so that the tools' bins and hybank's fit mean the same.
"""

import json
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
from adc_eval import signals
from adc_eval.adcs.basic import ADC
from adc_eval.eval import spectrum
from adctoolbox import analyze_spectrum, find_coherent_frequency
from adctoolbox.siggen.nonidealities import ADC_Signal_Generator

OUT = Path("tests/numerics/adc_records")
N = 4096


def interleaved():
    """adctoolbox's example exp_ti01: four converters in turn with its mismatches (seed 42), here with noise."""
    fs, turns, amplitude = 1e9, 4, 0.5
    tone, _ = find_coherent_frequency(fs, 17e6, N)
    rng = np.random.default_rng(42)
    gain = 1.0 + 0.02 * rng.standard_normal(turns)
    offset = 0.005 * rng.standard_normal(turns)
    skew = 3e-12 * rng.standard_normal(turns)
    skew -= skew.mean()
    n = np.arange(N)
    m = n % turns
    x = gain[m] * amplitude * np.cos(2 * np.pi * tone * (n / fs + skew[m])) + offset[m]
    return fs, turns, x + 1e-4 * rng.standard_normal(N)


def distorted():
    """adctoolbox's signal generator: two harmonics, thermal noise, 10 bits."""
    fs = 800e6
    tone, _ = find_coherent_frequency(fs, 80e6, N)
    np.random.seed(7)
    generator = ADC_Signal_Generator(N=N, Fs=fs, Fin=tone, A=0.49, DC=0.5)
    x = generator.apply_static_nonlinearity_hd(None, hd2_dB=-70, hd3_dB=-65)
    x = generator.apply_thermal_noise(x, noise_rms=180e-6)
    return fs, 1, generator.apply_quantization_noise(x, n_bits=10, quant_range=(0.0, 1.0)) - 0.5


def converter(bits, tone_bins, amplitude):
    """python-adc-eval's converter model, the codes over their number, from -1 to 1."""
    fs = 100e6
    adc = ADC(nbits=bits, fs=fs, vref=1, seed=3)
    vin = signals.sin(signals.time(N, fs=fs), amp=amplitude, offset=0, freq=tone_bins * fs / N, ph0=0.4)
    codes = np.empty(N)
    for i, v in enumerate(vin):
        adc.vin = float(v)
        adc.run_step()
        codes[i] = adc.dout
    return fs, 1, (codes + 0.5) / 2 ** (bits - 1) - 1.0


RECORDS = {
    "interleaved": interleaved,
    "distorted": distorted,
    "converter": lambda: converter(12, 411, 0.4995),
    "off-bin": lambda: converter(12, 411.1, 0.4995),
}


def write_wav(path, rate, samples):
    data = samples.astype("<f4").tobytes()
    header = struct.pack("<HHIIHH", 3, 1, int(rate), int(rate) * 4, 4, 32)
    body = b"WAVE" + b"fmt " + struct.pack("<I", len(header)) + header
    body += b"fact" + struct.pack("<II", 4, len(samples)) + b"data" + struct.pack("<I", len(data)) + data
    path.write_bytes(b"RIFF" + struct.pack("<I", len(body)) + body)


def by_adctoolbox(x, fs, window, side_bin):
    found = analyze_spectrum(x, fs=fs, max_scale_range=(-1.0, 1.0), win_type=window, side_bin=side_bin,
                             max_harmonic=10, create_plot=False)
    keys = {"sinad": "sndr_dbc", "snr": "snr_dbc", "thd": "thd_dbc", "sfdr": "sfdr_dbc", "enob": "enob",
            "noise_density": "nsd_dbfs_hz", "level": "sig_pwr_dbfs"}
    return {ours: round(float(found[theirs]), 4) for ours, theirs in keys.items()}


def by_adc_eval(x, window, leak):
    # With fs = 1: the tool adds the machine epsilon to each bin of its density, which is W/Hz, so that its noise
    # grows with the rate: at 100 MS/s it doubles the noise of 12 bits.
    _, _, found = spectrum.analyze(x, N, fs=1.0, dr=2.0, harmonics=10, leak=leak, window=window, no_plot=True)
    return {"sinad": float(found["sndr"]["dBc"]), "sfdr": float(found["sfdr"]["dBc"]),
            "enob_full_scale": float(found["enob"]["bits"]), "level": float(found["sig"]["dBFS"])}


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    figures = {}
    for name, make in RECORDS.items():
        fs, turns, samples = make()
        samples = samples.astype("<f4").astype(float)
        write_wav(OUT / f"{name}.wav", fs, samples)
        figures[name] = {
            "converters": turns,
            "adctoolbox, no window": by_adctoolbox(samples, fs, "rectangular", 0),
            "adctoolbox, hann": by_adctoolbox(samples, fs, "hann", None),
            "python-adc-eval, no window": by_adc_eval(samples, "rectangular", 0),
            "python-adc-eval, hanning": by_adc_eval(samples, "hanning", 3),
        }
    (OUT / "figures.json").write_text(json.dumps(figures, indent=1) + "\n")
    if len(sys.argv) > 1:
        print_table(sys.argv[1], figures)


def print_table(hybank, figures):
    columns = ["sinad", "enob", "enob_full_scale", "snr", "thd", "sfdr", "noise_density"]
    ours = {"sinad": "sinad_db", "enob": "enob_from_sinad", "enob_full_scale": "enob_full_scale", "snr": "snr_db",
            "thd": "thd_db", "sfdr": "sfdr_db", "noise_density": "noise_density_dbfs_per_hertz"}
    for name, tools in figures.items():
        args = [hybank, "measure", str(OUT / f"{name}.wav"), "--interleaved", str(tools.pop("converters")), "--json"]
        found = json.loads(subprocess.run(args, capture_output=True, check=True, text=True).stdout)
        rows = {"hybank measure": {key: found[theirs] for key, theirs in ours.items()}, **tools}
        print(f"\n| {name} | " + " | ".join(columns) + " |\n" + "| --- " * (len(columns) + 1) + "|")
        for tool, row in rows.items():
            cells = [f"{row[column]:.2f}" if column in row else "" for column in columns]
            print(f"| {tool} | " + " | ".join(cells) + " |")


main()
