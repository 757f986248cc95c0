"""The command `operator-panel`, and what `python -m app.check | app.log | app.simulator` do."""
