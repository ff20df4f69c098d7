"""Arguments, and what is read from answers."""

QUICK = ("--method", "following-p2", "--set", "elements=4", "--set", "steps=100")
BROKEN = {"status": "incomplete", "reason": "Newton's method stalled; take more steps"}


def file_contents(folder):
    """Every file below a folder with its content."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def fault_lines(err):
    assert all(line.startswith("cablefem: ") for line in err.splitlines())
    return [line.removeprefix("cablefem: ") for line in err.splitlines()]
