"""The words of the panel file's keys, and its JSON Schema: for the reference, for editors and for the
forms of `operator-panel edit`. The server imports none of it."""
