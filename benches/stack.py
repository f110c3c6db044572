# SPDX-License-Identifier: MIT OR Apache-2.0
"""Stack frames of the probe's functions on a bare-metal target: `python3 benches/stack.py [target]`.

Builds `tests/probe` with the compiler's table of frame sizes (`-Z emit-stack-sizes`, enabled in the stable compiler by
RUSTC_BOOTSTRAP) and prints the larger ones. The stack of a call is the sum of the frames along the chain of calls.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
SMALLEST = 64


def run(*command: str, **environment: str) -> str:
    """Return the output of a command."""
    everything = os.environ | environment
    return subprocess.run(command, cwd=ROOT, env=everything, check=True, stdout=subprocess.PIPE, text=True).stdout


def table(path: str) -> bytes:
    """Return the bytes of the section of frame sizes of a 32-bit ELF file."""
    line = next(line for line in run("readelf", "-SW", path).splitlines() if ".stack_sizes" in line)
    offset, size = (int(field, 16) for field in line.split("PROGBITS")[1].split()[1:3])
    return Path(path).read_bytes()[offset : offset + size]


def frames(data: bytes) -> dict[int, int]:
    """Return frame sizes by address; an entry has four little-endian bytes, then the size as a ULEB128 number."""
    found = {}
    at = 0
    while at < len(data):
        address = int.from_bytes(data[at : at + 4], "little")
        at += 4
        size = shift = 0
        while True:
            byte = data[at]
            at += 1
            size |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                break
        found[address & ~1] = size
    return found


def main() -> None:
    """Build, read and print."""
    target = sys.argv[1] if len(sys.argv) > 1 else "thumbv7em-none-eabihf"
    folder = "target/probe-stack"
    # Otherwise the linker would drop the table as an unreferenced section.
    flags = "-Z emit-stack-sizes -C link-arg=--no-gc-sections"
    build = ["cargo", "build", "--quiet", "--release", "--manifest-path", "tests/probe/Cargo.toml"]
    run(*build, "--target", target, "--target-dir", folder, RUSTC_BOOTSTRAP="1", RUSTFLAGS=flags)
    path = f"{folder}/{target}/release/probe"
    names = {}
    for line in run("nm", "-C", path).splitlines():
        address, _, name = line.split(maxsplit=2)
        names[int(address, 16) & ~1] = re.sub(r"::h[0-9a-f]{16}$", "", name)
    print(f"| function on {target} | frame [bytes] |\n|---|---|")
    for address, size in sorted(frames(table(path)).items(), key=lambda item: -item[1]):
        if size >= SMALLEST:
            print(f"| `{names.get(address, hex(address))}` | {size} |")


if __name__ == "__main__":
    main()
