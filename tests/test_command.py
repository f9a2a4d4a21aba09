"""What a log is told while something takes long."""

from pipeline import command


def test_a_log_has_how_many_the_rate_and_the_time_left(capsys):
    assert list(command.progress("abcd", 4, "letters", every_s=0.0)) == list("abcd")
    said = capsys.readouterr().err.splitlines()
    assert [line.split(" (")[0] for line in said] == ["letters: 1/4", "letters: 2/4", "letters: 3/4"]
    assert all(line.endswith(" s left)") and "/s, " in line for line in said)


def test_a_log_has_the_steps_of_one_piece_of_work(capsys):
    tell = command.steps("fusing mug", 2, every_s=0.0)
    tell("reading")
    tell("the surface")
    first, second = capsys.readouterr().err.splitlines()
    assert first.startswith("fusing mug: reading (step 1 of 2, ")
    assert second.startswith("fusing mug: the surface (step 2 of 2, ")


def test_what_is_quick_says_nothing(capsys):
    tell = command.steps("fusing mug", 1)
    tell("reading")
    assert list(command.progress(range(1000), 1000, "numbers")) == list(range(1000))
    assert capsys.readouterr().err == ""
