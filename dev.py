#!/usr/bin/env python3
"""Set up Trunnion in a fresh checkout and run it: needs Python 3.11 or newer with pip, nothing else.

python3 dev.py demo [...]      a sample part from mesh to printed on the software machine
python3 dev.py test [...]      the test suite (further words go to pytest)
python3 dev.py browser [...]   the tests that need chromium
python3 dev.py lint            formatting, lint, types and import rules
python3 dev.py run WORDS...    the trunnion command with those words
python3 dev.py lock            write requirements/*.txt anew from pyproject.toml
"""

import hashlib
import os
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent
VENV = ROOT / ".venv"
BIN = VENV / ("Scripts" if os.name == "nt" else "bin")
PYTHON = BIN / ("python.exe" if os.name == "nt" else "python")


def main(words: list[str]) -> int:
    """Run one of the commands of the module's docstring; the exit status is that of what was run."""
    if sys.version_info < (3, 11):  # noqa: UP036  (this file is what an older Python would meet first)
        print(f"dev.py: this is Python {sys.version.split()[0]}; Trunnion needs 3.11 or newer", file=sys.stderr)
        return 2
    command, rest = (words[0], words[1:]) if words else ("", [])
    if command == "demo":
        install("run")
        return run(PYTHON, "-m", "trunnion", "demo", *rest)
    if command == "run":
        install("run")
        return run(PYTHON, "-m", "trunnion", *rest)
    if command == "test":
        install("dev")
        return run(PYTHON, "-m", "pytest", "-n", "auto", "--dist", "worksteal", *rest)
    if command == "browser":
        install("dev")
        return run(PYTHON, "-m", "pytest", "-m", "browser", "tests/browser", *rest)
    if command == "lint":
        install("dev")
        return max(
            run(PYTHON, "-m", "ruff", "format", "--check", "."),
            run(PYTHON, "-m", "ruff", "check", "."),
            run(PYTHON, "-m", "mypy"),
            run(BIN / "lint-imports"),
        )
    if command == "lock":
        return lock()
    print(__doc__, file=sys.stderr)
    return 0 if command in ("-h", "--help") else 2


def install(kind: str) -> None:
    """Make `.venv` hold the pinned requirements of that kind and the project itself; at once where it already does."""
    pins = [ROOT / "requirements" / name for name in (("run.txt",) if kind == "run" else ("run.txt", "dev.txt"))]
    stamp = VENV / f"installed-{kind}"
    text = "".join(path.read_text() for path in [*pins, ROOT / "pyproject.toml"])
    wanted = hashlib.sha256(f"{sys.version}{ROOT}{text}".encode()).hexdigest()
    if PYTHON.exists() and stamp.exists() and stamp.read_text() == wanted:
        return
    print(f"dev.py: installing into {VENV.name} (once)", file=sys.stderr, flush=True)
    if not PYTHON.exists():
        venv.create(VENV, with_pip=True, clear=VENV.exists())
    pip = (PYTHON, "-m", "pip", "install", "--quiet", "--disable-pip-version-check")
    check(*pip, "--require-hashes", "-r", pins[-1])
    check(*pip, "--no-deps", "--no-build-isolation", "--editable", ROOT)
    stamp.write_text(wanted)


def lock() -> int:
    """Resolve pyproject.toml into pinned, hashed requirements: run.txt for users, dev.txt with developers' tools."""
    install("dev")
    check(PYTHON, "-m", "pip", "install", "--quiet", "uv")
    compiled: list[str | Path] = [PYTHON, "-m", "uv", "pip", "compile", "--quiet", "--universal", "--generate-hashes"]
    compiled += ["--no-header", "--no-annotate", "--python-version", "3.11", ROOT / "pyproject.toml"]
    compiled += ["--extra", "build"]
    check(*compiled, "-o", ROOT / "requirements" / "run.txt")
    check(*compiled, "--extra", "dev", "-o", ROOT / "requirements" / "dev.txt")
    return 0


def run(*words: str | Path) -> int:
    """Run a program in the checkout and return its exit status."""
    return subprocess.run([str(word) for word in words], cwd=ROOT, check=False).returncode


def check(*words: str | Path) -> None:
    """Run a program in the checkout and stop here if it fails."""
    status = run(*words)
    if status:
        sys.exit(status)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
