"""What a log is told while something takes long."""

import signal
import subprocess
import sys
import threading
import time

from pipeline import command


def test_a_log_has_how_many_the_rate_and_the_time_left(capsys):
    assert list(command.progress("abcd", 4, "letters", every_s=0.0)) == list("abcd")
    said = capsys.readouterr().err.splitlines()
    assert [line.split(" (")[0] for line in said] == ["letters: 1/4", "letters: 2/4", "letters: 3/4"]
    assert all(line.endswith(" s left)") and "/s, " in line for line in said)


def test_a_log_has_the_step_that_takes_long(capsys):
    before = threading.active_count()
    with command.steps("fusing mug", 3, every_s=0.02) as tell:
        tell("reading")
        tell("the surface")
        said = ""
        while "surface" not in said:
            said += capsys.readouterr().err
            time.sleep(0.01)
    assert "fusing mug: the surface (step 2 of 3, " in said
    assert threading.active_count() == before


def test_what_is_quick_says_nothing(capsys):
    with command.steps("fusing mug", 1) as tell:
        tell("reading")
    assert list(command.progress(range(1000), 1000, "numbers")) == list(range(1000))
    assert capsys.readouterr().err == ""


def test_ctrl_c_ends_a_program_without_a_word():
    code = "from pipeline import command\ndef main(): raise KeyboardInterrupt\ncommand.run(main)"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (-signal.SIGINT, "")
