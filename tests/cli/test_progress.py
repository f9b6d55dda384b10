"""Time left and the plain lines."""

import pytest

from murmillo.cli.progress import PlainLines, Schedule, clock


def test_time_left_is_by_samples_or_by_the_clock() -> None:
    # 1,000 of 5,000 samples in 10 s: 100 a second, 40 s for the rest
    assert Schedule(5000, 0, None).seconds_left(1000, 10.0) == pytest.approx(40.0)
    assert Schedule(5000, 0, 0.5).seconds_left(1000, 10.0) == pytest.approx(20.0)
    # a resumed run had 600 already: 400 in 10 s is 40 a second, 100 s for the rest
    assert Schedule(5000, 600, None).seconds_left(1000, 10.0) == pytest.approx(100.0)
    assert Schedule(1000, 0, None).seconds_left(1200, 10.0) == 0.0


def test_a_line_every_ten_seconds(capsys: pytest.CaptureFixture[str]) -> None:
    lines = PlainLines(Schedule(5000, 0, None))
    for seconds in (1.0, 5.0, 10.9, 11.0, 12.0):
        lines.show(1000, seconds, {"reward/style": 0.25, "episode/length": float("nan")})
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) == 2
    assert printed[1] == "1,000 samples, 91/s, 0:44 left, episode length -, style reward 0.250"


def test_clock() -> None:
    assert (clock(8.4), clock(510), clock(3723)) == ("0:08", "8:30", "1:02:03")
