"""run.py without network and without a real installation: its pure helpers, its messages, its order of steps."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def runner():
    spec = importlib.util.spec_from_file_location("rverror_run_py", ROOT / "run.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def checkout(tmp_path):
    folder = tmp_path / "a folder with spaces"
    folder.mkdir()
    (folder / "pyproject.toml").write_text("[project]\n", encoding="utf-8")
    return folder


class Commands:
    """Stands in for `run_quietly`: notes every command, answers each kind from a list of (code, output)."""

    def __init__(self, folder, runner, **answers):
        self.folder, self.runner, self.answers, self.seen = folder, runner, answers, []

    def __call__(self, command, *, cwd=None):
        kind = "health" if command[1] == "-c" else command[2]
        if kind == "health" and len(command) > 4:
            kind = "modules"
        if command[-1] == self.runner.FIRST_EQUILIBRIUM:
            kind = "kernels"
        self.seen.append(kind)
        if kind == "venv":
            (self.folder / ".venv").mkdir()
        answers = self.answers.get(kind, [(0, "")])
        return answers.pop(0) if len(answers) > 1 else answers[0]


@pytest.fixture
def with_commands(runner, checkout, monkeypatch):
    def make(**answers):
        commands = Commands(checkout, runner, **answers)
        monkeypatch.setattr(runner, "run_quietly", commands)
        monkeypatch.setattr(runner, "modules_missing", list)
        return commands

    return make


def test_too_old_python_is_told_what_is_needed(runner):
    assert runner.version_problem((3, 10, 9)) == (
        "Python 3.10 is too old: rverror needs 3.11 or newer; run this file with a newer one"
    )
    assert runner.version_problem((2, 7, 18))
    assert runner.version_problem((3, 11, 0)) == runner.version_problem((4, 0)) == ""


def test_version_in_run_py_is_that_of_pyproject(runner):
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert 'requires-python = ">={}.{}"'.format(*runner.PYTHON_NEEDED) in text


def test_interpreter_lies_where_each_system_puts_it(runner):
    venv = Path("some where") / ".venv"
    assert runner.venv_python(venv, windows=False) == venv / "bin" / "python"
    assert runner.venv_python(venv, windows=True) == venv / "Scripts" / "python.exe"


def test_stamp_changes_with_all_that_an_editable_install_holds_for(runner):
    base = runner.stamp(b"a", root=Path("x"), version="3.11")
    assert base == runner.stamp(b"a", root=Path("x"), version="3.11")
    others = {
        runner.stamp(b"b", root=Path("x"), version="3.11"),
        runner.stamp(b"a", root=Path("y"), version="3.11"),
        runner.stamp(b"a", root=Path("x"), version="3.12"),
    }
    assert len(others | {base}) == 4


@pytest.mark.parametrize(
    ("text", "extra", "current"),
    [
        ("abc plot\n", "plot", True),
        ("abc test\n", "plot", True),
        ("abc test\n", "test", True),
        ("abc plot\n", "test", False),
        ("abd test\n", "test", False),
        ("abc", "plot", False),
        ("", "plot", False),
    ],
)
def test_environment_is_reused_only_for_what_it_holds(runner, text, extra, current):
    assert runner.is_current(text, "abc", extra) is current


def test_test_extra_holds_all_modules_of_plot(runner):
    assert set(runner.MODULES["plot"]) < set(runner.MODULES["test"])
    assert set(runner.EXTRAS.values()) == set(runner.MODULES)


def test_extras_are_those_of_pyproject(runner):
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    section = text.split("[project.optional-dependencies]")[1].split("\n[")[0]
    for extra in runner.EXTRAS.values():
        assert f"\n{extra} = [" in section


def test_stamp_file_round_trip_and_absence(runner, tmp_path):
    assert runner.read_stamp(tmp_path) == ""
    runner.write_stamp(tmp_path, "abc test")
    assert runner.is_current(runner.read_stamp(tmp_path), "abc", "test")
    assert [p.name for p in tmp_path.iterdir()] == [runner.STAMP]


def test_child_environment_drops_what_leads_pip_elsewhere(runner):
    given = {"PATH": "p", "PYTHONPATH": "x", "PIP_USER": "1", "PIP_INDEX_URL": "keep"}
    assert runner.child_environment(given) == {"PATH": "p", "PIP_INDEX_URL": "keep"}
    assert "PYTHONPATH" in given


def test_missing_venv_message_names_the_package(runner):
    message = runner.venv_missing_message((3, 12))
    assert "sudo apt install python3.12-venv" in message
    assert "python3-venv" in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("output", "hint"),
    [
        ("ERROR: Could not find a version that satisfies the requirement hatchling", "network"),
        ("WARNING: Retrying ... Temporary failure in name resolution", "network"),
        ("error: metadata-generation-failed", "delete the .venv folder"),
    ],
)
def test_pip_message_shows_the_last_lines_and_a_hint(runner, output, hint):
    text = "\n".join(f"line {i}" for i in range(50)) + "\n\n" + output
    message = runner.pip_message(text)
    assert output in message
    assert "line 30" not in message
    assert "line 45" in message
    assert hint in message.splitlines()[-1]


@pytest.mark.parametrize("arguments", [[], ["wrong"], ["Test"], ["--version"]])
def test_wrong_command_gives_usage_and_2(runner, arguments, capsys):
    assert runner.main(arguments) == 2
    assert "python run.py test" in capsys.readouterr().err


def test_help_gives_usage_and_0(runner, capsys):
    assert runner.main(["--help"]) == 0
    assert capsys.readouterr().out.startswith("usage: python run.py demo")


def test_usage_from_another_folder(tmp_path):
    done = subprocess.run([sys.executable, str(ROOT / "run.py")], cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith(b"usage:")
    assert done.stdout == b""


def test_first_run_makes_installs_and_stamps(runner, checkout, with_commands, capsys):
    commands = with_commands(health=[(1, "")])
    runner.environment("test", checkout)
    assert commands.seen == ["health", "venv", "pip", "modules"]  # the kernels are compiled beside mypy
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) == 2
    assert all(line.startswith("run.py: ") for line in printed)
    assert runner.read_stamp(checkout / ".venv").strip().endswith(" test")


def test_second_run_only_looks(runner, checkout, with_commands, capsys):
    with_commands(health=[(1, "")])
    runner.environment("test", checkout)
    commands = with_commands()
    runner.environment("test", checkout)
    runner.environment("demo", checkout)
    assert commands.seen == ["modules", "modules"]
    assert "using the environment" in capsys.readouterr().out


def test_changed_pyproject_installs_into_the_working_environment(runner, checkout, with_commands):
    with_commands(health=[(1, "")])
    runner.environment("demo", checkout)
    (checkout / "pyproject.toml").write_text("[project]\n# changed\n", encoding="utf-8")
    commands = with_commands()
    runner.environment("demo", checkout)
    assert commands.seen == ["health", "pip", "modules", "kernels"]


def test_broken_environment_is_made_anew(runner, checkout, with_commands, capsys):
    (checkout / ".venv").mkdir()
    (checkout / ".venv" / "half").touch()
    commands = with_commands(health=[(1, "no pip")])
    runner.environment("demo", checkout)
    assert commands.seen == ["health", "venv", "pip", "modules", "kernels"]
    assert "does not work; removing it" in capsys.readouterr().out
    assert not (checkout / ".venv" / "half").exists()


def test_install_that_leaves_a_module_out_is_repeated_from_scratch(runner, checkout, with_commands):
    (checkout / ".venv").mkdir()
    commands = with_commands(modules=[(1, "")])
    runner.environment("demo", checkout)
    assert commands.seen == ["health", "pip", "modules", "venv", "pip", "kernels"]


def test_failed_install_leaves_no_stamp(runner, checkout, with_commands):
    with_commands(health=[(1, "")], pip=[(1, "ERROR: No matching distribution found for hatchling")])
    with pytest.raises(runner.SetupError, match="check the network"):
        runner.environment("test", checkout)
    assert runner.read_stamp(checkout / ".venv") == ""


def test_interrupted_install_leaves_no_stamp_of_the_old_one(runner, checkout, with_commands, monkeypatch):
    with_commands(health=[(1, "")])
    runner.environment("demo", checkout)

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(runner, "install", interrupted)
    with pytest.raises(KeyboardInterrupt):
        runner.environment("test", checkout)
    assert runner.read_stamp(checkout / ".venv") == ""


def test_missing_ensurepip_before_and_after_the_try(runner, checkout, with_commands, monkeypatch):
    with_commands(health=[(1, "")], venv=[(1, "ensurepip is not available")])
    with pytest.raises(runner.SetupError, match="apt install"):
        runner.environment("test", checkout)
    assert not (checkout / ".venv").exists()
    commands = with_commands(health=[(1, "")])
    monkeypatch.setattr(runner, "modules_missing", lambda: ["ensurepip"])
    with pytest.raises(runner.SetupError, match="apt install"):
        runner.environment("test", checkout)
    assert "venv" not in commands.seen


def test_read_only_checkout(runner, checkout, with_commands, monkeypatch):
    with_commands(health=[(1, "")])

    def refuse(**_):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(runner.tempfile, "TemporaryFile", refuse)
    with pytest.raises(runner.SetupError, match=r"Read-only file system.*copy the checkout"):
        runner.environment("test", checkout)


def test_setup_error_ends_with_2_and_one_line(runner, monkeypatch, capsys):
    def refuse(command):
        raise runner.SetupError("because")

    monkeypatch.setattr(runner, "environment", refuse)
    assert runner.main(["demo"]) == 2
    assert capsys.readouterr().err == "run.py: because\n"


@pytest.mark.parametrize(
    ("codes", "result"),
    [((0, 0, 0, 0), 0), ((1, 0, 0, 0), 1), ((1, 0, 2, 0), 2), ((0, 0, 2, 0), 2), ((1, 2, 3, 5), 5)],
)
def test_every_step_runs_and_the_last_failure_counts(runner, monkeypatch, capsys, codes, result):
    left, seen = dict(zip(("check", "format", "mypy", "pytest"), codes, strict=True)), []

    def note(command, *, cwd=None):
        seen.append(command)
        return next(left.pop(word) for word in command[2:] if word in left)

    monkeypatch.setattr(runner, "run", note)
    monkeypatch.setattr(runner, "run_quietly", lambda command, *, cwd: (note(command), "what mypy said"))
    monkeypatch.setattr(runner, "compile_kernels", lambda python: seen.append(["kernels"]))
    assert runner.run_checks(Path("python"), ["-k", "x"]) == result
    assert not left
    assert seen[-1][-2:] == ["-k", "x"]  # the last word is the user's
    assert ["kernels"] in seen[:-1]  # compiled before pytest's processes would do it
    assert "-n" in seen[-1]
    output = capsys.readouterr()
    assert ("what mypy said" in output.out) is (codes[2] != 0)
    if not codes[2]:
        assert output.out.splitlines()[-1] == "run.py: pytest"  # nothing of run.py's after pytest's own lines
    assert ("ruff check FAILED (exit 1)" in output.err) is (codes[0] == 1)
    assert ("mypy FAILED (exit 2)" in output.err) is (codes[2] == 2)
    assert bool(output.err) is any(codes[:3])


def test_demo_passes_its_arguments_on(runner, monkeypatch):
    seen = []
    monkeypatch.setattr(runner, "environment", lambda command: Path("python"))
    monkeypatch.setattr(runner, "run", lambda command, *, cwd=None: seen.append(command) or 7)
    assert runner.main(["demo", "--output", "a b"]) == 7
    assert seen == [["python", "-m", "rverror", "demo", "--output", "a b"]]


def test_real_helpers_run_a_command_and_remove_what_is_there(runner, tmp_path):
    code, output = runner.run_quietly([sys.executable, "-c", "import sys; print('x'); sys.exit(3)"])
    assert (code, output.strip()) == (3, "x")
    code, output = runner.run_quietly([str(tmp_path / "no such program")])
    assert code == 1
    assert output
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "file").touch()
    (tmp_path / "file").touch()
    for name in ("folder", "file", "nothing"):
        runner.remove(tmp_path / name)
    assert not any(tmp_path.iterdir())


def test_this_interpreter_is_healthy_and_a_missing_module_is_seen(runner):
    python = Path(sys.executable)
    assert runner.is_healthy(python, ("json",))
    assert not runner.is_healthy(python, ("no_such_module_anywhere",))


@pytest.mark.skipif(os.name == "nt", reason="the check script is for bash")
def test_what_compiles_the_kernels_solves_an_equilibrium(runner):
    subprocess.run(
        [sys.executable, "-c", runner.FIRST_EQUILIBRIUM + "; import sys; assert 'numba' in sys.modules"], check=True
    )


def test_ci_script_removes_the_environment_and_runs_the_check():
    text = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert "set -euo pipefail" in text
    assert text.index("rm -rf .venv") < text.index("run.py test")
    assert os.access(ROOT / ".ci" / "run", os.X_OK)
    assert subprocess.run(["bash", "-n", str(ROOT / ".ci" / "run")], check=False).returncode == 0
