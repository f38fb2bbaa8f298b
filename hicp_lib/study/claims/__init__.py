"""The paper's claims as data, and the verdicts that a run's result files give on them."""
