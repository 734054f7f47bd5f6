"""Bytes and tables that know no record: safe reading, CSV, .mat and light files."""
