"""The small overlay's objects, and the jobs of a rule with each of them as a plan names them."""

OBJECTS = {"mug", "short_cup", "wide_bowl"}


def each(rule: str, objects=frozenset(OBJECTS)) -> set[str]:
    """Return the jobs of a rule, one an object."""
    return {f"{rule} {name}" for name in objects}
