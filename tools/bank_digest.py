"""The digest of a bank file by another route than core/src/bank/digest.rs, for its test: python3 bank_digest.py BANK.json"""
import hashlib
import json
import struct
import sys


def canonical(value, left_out=()):
    if isinstance(value, bool):
        return b"t" if value else b"f"
    if isinstance(value, (int, float)):
        return b"#" + struct.pack(">d", float(value))
    if isinstance(value, str):
        text = value.encode()
        return b'"' + struct.pack(">Q", len(text)) + text
    if isinstance(value, list):
        return b"[" + b"".join(map(canonical, value)) + b"]"
    if value is None:
        return b""
    members = sorted((k.encode(), k) for k, v in value.items() if v is not None and k not in left_out)
    return b"{" + b"".join(canonical(k) + canonical(value[k]) for _, k in members) + b"}"


bank = json.load(open(sys.argv[1]))
print("sha256:" + hashlib.sha256(canonical(bank, ("digest", "meta"))).hexdigest())
