"""Make a virtual environment beside this file, install rverror in it, and run the demo or the whole check.

    python run.py demo [arguments of `rverror demo`]
    python run.py test [arguments of pytest]

Needs nothing but Python and, the first time, a network.
"""

import sys

PYTHON_NEEDED = (3, 11)


def version_problem(version):
    """One line that says what to do where Python is too old; empty where it is not."""
    if tuple(version[:2]) >= PYTHON_NEEDED:
        return ""
    return "Python {}.{} is too old: rverror needs {}.{} or newer; run this file with a newer one".format(
        *version[:2], *PYTHON_NEEDED
    )


# before anything that an older Python cannot read
if version_problem(sys.version_info):
    sys.stderr.write("run.py: " + version_problem(sys.version_info) + "\n")
    sys.exit(2)

import contextlib  # noqa: E402
import hashlib  # noqa: E402
import importlib.util  # noqa: E402
import os  # noqa: E402
import shutil  # noqa: E402
import subprocess  # noqa: E402
import tempfile  # noqa: E402
from concurrent.futures import ThreadPoolExecutor  # noqa: E402
from pathlib import Path  # noqa: E402

USAGE = """usage: python run.py demo [arguments of `rverror demo`]
       python run.py test [arguments of pytest]

demo   install rverror with its plots, run its example from start to end
test   install rverror with its checks, run ruff, mypy and pytest; with --quick a minute's choice of the tests"""

ROOT = Path(__file__).resolve().parent
STAMP = "rverror-stamp"
#: The extra that each command installs, and the modules that it must bring.
EXTRAS = {"demo": "plot", "test": "test"}
MODULES = {
    "plot": ("rverror", "matplotlib"),
    "test": ("rverror", "matplotlib", "pytest", "xdist", "hypothesis", "mypy", "ruff"),
}
#: Solves one angle, so that the equilibrium's machine code lies in its cache for all that follows.
FIRST_EQUILIBRIUM = (
    "import rverror; rverror.equilibrium(rverror.Model(rverror.reducer('RV-40E')), [0.0], torque='1 N*m', direction=1)"
)
#: On every core, but not with more processes than memory has room for.  A file stays with one process, as its tests
#: share what took long to make; the files in their order, so that the last ones are short.
IN_PARALLEL = ("-n", "auto", "--maxprocesses", "4", "--dist", "loadfile", "--no-loadscope-reorder")
NO_NETWORK = (
    "connection",
    "name resolution",
    "getaddrinfo",
    "timed out",
    "max retries",
    "network is unreachable",
    "proxy",
    "ssl",
    "no matching distribution",
    "could not find a version",
)


class SetupError(Exception):
    """The environment cannot be made; the message says why, and what to do."""


def say(message: str) -> None:
    """Print one step, before what its command prints."""
    print(f"run.py: {message}", flush=True)


def venv_python(venv: Path, *, windows: bool = os.name == "nt") -> Path:
    """The interpreter of a virtual environment."""
    return venv / "Scripts" / "python.exe" if windows else venv / "bin" / "python"


def stamp(pyproject: bytes, *, root: Path, version: str = sys.version) -> str:
    """What the environment was made for: an editable install holds for one pyproject.toml, folder and Python."""
    digest = hashlib.sha256(pyproject)
    digest.update(f"\0{root}\0{version}".encode())
    return digest.hexdigest()


def is_current(text: str, wanted: str, extra: str) -> bool:
    """Tell whether a stamp file's text covers an extra; `test` holds all that `plot` does."""
    digest, _, installed = text.strip().partition(" ")
    return digest == wanted and installed in (extra, "test")


def child_environment(environment: dict[str, str]) -> dict[str, str]:
    """Copy of an environment without what would lead the new interpreter or its pip elsewhere.

    Byte code is kept whatever the caller's shell says, or every process of the checks would compile the package anew.
    """
    unwanted = {"PYTHONPATH", "PYTHONHOME", "PYTHONDONTWRITEBYTECODE", "__PYVENV_LAUNCHER__"}
    unwanted |= {"PIP_USER", "PIP_TARGET", "PIP_PREFIX"}
    return {name: value for name, value in environment.items() if name.upper() not in unwanted}


def run(command: list[str], *, cwd: Path | None = None) -> int:
    """Run a command with its output on the screen; its exit code."""
    return subprocess.run(command, cwd=cwd, env=child_environment(dict(os.environ)), check=False).returncode


def run_quietly(command: list[str], *, cwd: Path | None = None) -> tuple[int, str]:
    """Run a command; its exit code and all that it printed."""
    try:
        done = subprocess.run(
            command,
            cwd=cwd,
            env=child_environment(dict(os.environ)),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            errors="replace",
            check=False,
        )
    except OSError as error:  # a broken link, or a file that is no program
        return 1, str(error)
    return done.returncode, done.stdout


def last_lines(text: str, count: int = 12) -> str:
    """The last lines of a program's output that are not blank, indented."""
    lines = [line.rstrip() for line in text.splitlines() if line.strip()]
    return "\n".join("    " + line for line in lines[-count:])


def venv_missing_message(version: tuple[int, ...] = sys.version_info[:2]) -> str:
    """What to install where Python came without the means to make an environment."""
    return (
        "this Python cannot make virtual environments (venv or ensurepip is missing); on Debian and Ubuntu: "
        f"sudo apt install python{version[0]}.{version[1]}-venv (or python3-venv); elsewhere install a full Python"
    )


def read_only_message(root: Path, error: OSError) -> str:
    """What to do where the environment's folder cannot be written."""
    reason = error.strerror or error
    return f"cannot write in {root} ({reason}); copy the checkout to a folder that you can write to, and run it there"


def pip_message(output: str) -> str:
    """What pip said at the end, and a hint."""
    lower = output.lower()
    if any(sign in lower for sign in NO_NETWORK):
        hint = "pip could not fetch the packages: check the network, or the proxy and index that pip is told to use"
    else:
        hint = "run it again; if it fails again, delete the .venv folder first"
    return f"pip could not install rverror; its last lines:\n{last_lines(output)}\n  {hint}"


def modules_missing() -> list[str]:
    """Modules that an environment is made with and this Python lacks."""
    return [name for name in ("venv", "ensurepip") if importlib.util.find_spec(name) is None]


def is_healthy(python: Path, modules: tuple[str, ...]) -> bool:
    """Tell whether an interpreter runs, has pip, is this Python and finds the modules."""
    code = (
        "import sys, importlib.util as u, pip\n"
        "sys.exit(sys.argv[1] != sys.version or any(u.find_spec(m) is None for m in sys.argv[2:]))"
    )
    return run_quietly([str(python), "-c", code, sys.version, *modules])[0] == 0


def remove(path: Path) -> None:
    """Remove a folder, file or link, if it is there."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    elif path.exists() or path.is_symlink():
        path.unlink()


def read_stamp(venv: Path) -> str:
    """Text of the stamp file; empty where there is none."""
    with contextlib.suppress(OSError, UnicodeDecodeError):
        return (venv / STAMP).read_text(encoding="utf-8")
    return ""


def write_stamp(venv: Path, text: str) -> None:
    """Write the stamp in one move, so that an interrupted run leaves none."""
    new = venv / (STAMP + ".new")
    new.write_text(text + "\n", encoding="utf-8")
    os.replace(new, venv / STAMP)


def make_venv(venv: Path) -> None:
    """Make the environment anew."""
    if modules_missing():
        raise SetupError(venv_missing_message())
    if venv.exists() or venv.is_symlink():
        say(f"{venv.name} does not work; removing it")
        remove(venv)
    say(f"making the environment {venv}")
    code, output = run_quietly([sys.executable, "-m", "venv", str(venv)])
    if code:
        with contextlib.suppress(OSError):
            remove(venv)
        if "ensurepip" in output:
            raise SetupError(venv_missing_message())
        raise SetupError(f"cannot make the environment; the last lines:\n{last_lines(output)}")


def install(python: Path, extra: str, root: Path) -> None:
    """Install the package, editable, with an extra."""
    say(f"installing rverror[{extra}] with pip (the first time this takes a minute or two)")
    command = [str(python), "-m", "pip", "install", "--disable-pip-version-check", "--no-input"]
    command += ["--no-compile", "-e", f".[{extra}]"]  # what is imported is compiled then: half of pip's time is saved
    code, output = run_quietly(command, cwd=root)
    if code:
        raise SetupError(pip_message(output))


def compile_kernels(python: Path) -> None:
    """Compile what runs compiled; where this fails, the first command that needs it says why."""
    say("compiling the equilibrium, the first time; some 20 s")
    run_quietly([str(python), "-c", FIRST_EQUILIBRIUM])


def environment(command: str, root: Path = ROOT) -> Path:
    """Make the environment of a command, or take the one that is there; its interpreter.

    A stamp is written after the last step only.  An environment without a current one is completed when its
    interpreter works, and made anew when it does not.
    """
    venv = root / ".venv"
    python, extra = venv_python(venv), EXTRAS[command]
    wanted = stamp((root / "pyproject.toml").read_bytes(), root=root)
    if is_current(read_stamp(venv), wanted, extra) and is_healthy(python, MODULES[extra]):
        say(f"using the environment {venv}")
        return python
    try:
        with tempfile.TemporaryFile(dir=root):
            pass
        (venv / STAMP).unlink(missing_ok=True)
        if not is_healthy(python, ()):
            make_venv(venv)
        install(python, extra, root)
        if not is_healthy(python, MODULES[extra]):  # pip took remains of an earlier try for the real thing
            make_venv(venv)
            install(python, extra, root)
        if command != "test":  # the checks do it beside mypy
            compile_kernels(python)
        write_stamp(venv, f"{wanted} {extra}")
    except OSError as error:
        raise SetupError(read_only_message(root, error)) from error
    return python


def checks(python: str, arguments: list[str]) -> dict[str, list[str]]:
    """The steps of `test` by name."""
    return {
        "ruff check": [python, "-m", "ruff", "check", "."],
        "ruff format": [python, "-m", "ruff", "format", "--check", "."],
        "mypy": [python, "-m", "mypy"],
        "pytest": [python, "-m", "pytest", *IN_PARALLEL, *arguments],
    }


def summary(codes: dict[str, int]) -> str:
    """One line: every step and how it went."""
    return ", ".join(f"{name} {'ok' if code == 0 else f'FAILED (exit {code})'}" for name, code in codes.items())


def last_failure(codes: dict[str, int]) -> int:
    """Exit code of the last step that failed; 0 where none did."""
    return next((code for code in reversed(codes.values()) if code), 0)


def run_checks(python: Path, arguments: list[str], root: Path = ROOT) -> int:
    """Run every step, also after one that failed; pytest's closing line is the last, unless another step failed.

    mypy works on one core only, half a minute the first time: it runs beside the others, and its words come last.  So
    does the compiler of what runs compiled, but before pytest, whose processes would each do it.
    """
    steps = checks(str(python), arguments)
    with ThreadPoolExecutor(max_workers=1) as beside:
        say("mypy, beside what follows; silent where it finds nothing")
        mypy = beside.submit(run_quietly, steps["mypy"], cwd=root)
        codes = dict.fromkeys(steps, 0)
        compile_kernels(python)
        for name in ("ruff check", "ruff format", "pytest"):
            say(name)
            codes[name] = run(steps[name], cwd=root)
        codes["mypy"], found = mypy.result()
    if codes["mypy"]:
        print(f"run.py: mypy\n{found.rstrip()}", flush=True)
    if any(code for name, code in codes.items() if name != "pytest"):
        sys.stdout.flush()
        print(f"run.py: {summary(codes)}", file=sys.stderr)
    return last_failure(codes)


def main(arguments: list[str]) -> int:
    """Run one command; its exit code."""
    if arguments[:1] in (["-h"], ["--help"]):
        print(USAGE)
        return 0
    if not arguments or arguments[0] not in EXTRAS:
        print(USAGE, file=sys.stderr)
        return 2
    command, *rest = arguments
    try:
        python = environment(command)
        if command == "test":
            return run_checks(python, rest)
        say("running the demo")
        return run([str(python), "-m", "rverror", "demo", *rest])
    except SetupError as error:
        print(f"run.py: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("run.py: interrupted; run it again to go on", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
