"""How every command answers a user's mistake."""


def assert_refused(done: tuple[int, str, str], *parts: str) -> None:
    """Exit status 2, and one line on standard error that holds these parts; `done` is status, output and errors."""
    status, out, err = done
    assert status == 2, out + err
    assert err.startswith("murmillo: ")
    assert err.count("\n") == 1, err
    for part in parts:
        assert part in err
