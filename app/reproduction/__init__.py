"""The paper's experiments, repeated: one command, records that can be resumed, tables and figures."""
