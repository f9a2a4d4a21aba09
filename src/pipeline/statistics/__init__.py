"""How sure a score is when trials of one object are no independent evidence: knows no stage."""
