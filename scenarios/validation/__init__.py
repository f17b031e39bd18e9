"""`dotmask validate`: measures whether every stage does what the documents say, and writes docs/validation.md."""
