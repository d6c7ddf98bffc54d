#!/bin/sh
# Makes core/tests/fixtures/two.flac with Python and ffmpeg: 3,000 frames at 24 kHz, 1 kHz in the left channel and 1.7 kHz
# in the right one, amplitude 16000 of 32768.
set -e
cd "$(dirname "$0")/../core/tests/fixtures"
python3 - <<'PY'
import math, struct, wave
with wave.open("two.wav", "wb") as out:
    out.setnchannels(2); out.setsampwidth(2); out.setframerate(24000)
    for n in range(3000):
        pair = [round(16000 * math.sin(2 * math.pi * f * n / 24000)) for f in (1000, 1700)]
        out.writeframes(struct.pack("<2h", *pair))
PY
ffmpeg -v error -y -bitexact -i two.wav -c:a flac -frame_size 512 two.flac
rm two.wav
