"""Command for a bench's own files: read."""

from __future__ import annotations

import argparse
from pathlib import Path

from rverror.app.terminal import MAPPING, command, flag, option, output, tell, write_text_output
from rverror.base.errors import InputError
from rverror.runs.bench.draft import drafted
from rverror.runs.measurement import load_run, run_text
from rverror.runs.order_file import orders_text, refuse_order_file
from rverror.runs.order_table import OrderTable


@command(
    example="bench.tdms --mapping bench.toml -o run.csv",
    options={
        "file": option("BENCH.tdms", "file of the bench, in any format that a mapping describes", reads=True),
        **MAPPING,
        "--draft": flag("write a draft of the mapping instead; its comments list what the bench's file holds"),
        **output("RUN.csv", "file to write (default: standard output)"),
    },
)
def _read(options: argparse.Namespace) -> None:
    """Read a bench file and write a run file or an order table.

    Reads a file in a bench's format (text, MAT, HDF5, TDMS) and writes a run file or an order table. A
    mapping says what the columns are; --draft writes a first version of it.
    """
    refuse_order_file(options.file)
    if options.draft:
        if options.mapping:
            raise InputError("--draft begins a mapping; leave out --draft or --mapping")
        text, remarks = drafted(options.file)
        tell(*(f"{options.file}: {remark}" for remark in remarks))
        return write_text_output(options.output, text)
    read = load_run(options.file, mapping=options.mapping)
    names = [Path(path).name for path in options.inputs]
    # In brackets, so that no note can be read back as a line of the header.
    comments = [f"(read from {' by '.join(names)})", *(f"({note})" for note in read.notes)]
    text_of = orders_text if isinstance(read, OrderTable) else run_text
    text = text_of(read, comments=comments, path=options.output or options.file)  # type: ignore[arg-type]
    tell(*(f"{options.file}: {note}" for note in read.notes))
    write_text_output(options.output, text)
