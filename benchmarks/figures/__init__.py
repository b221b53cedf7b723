"""Render every figure of README.md and docs/ from docs/results/<experiment>.json.

`python -m benchmarks.figures [--check]`. Pages carry markers, HTML comments that no renderer shows; what stands
between two of them is made here.

    <!--f mapping:ours/middle/PQ-->76.0 % [74.3, 77.5]<!--/f-->   a figure with its unit and its interval; `cases`: with
                                                  their number too; `bare`: the number alone; `.2`: two decimals
    <!-- table mapping (TOML) -->...<!-- /table -->               a table: rows, columns, labels, digits (see `table`)
    <!-- rows real entities -->...<!-- /rows -->                  a table of words, as it stands in the JSON
    <!-- about mapping -->...<!-- /about -->                      what the figures do not show, and where they are from
    <!-- headlines (TOML) -->...<!-- /headlines -->               figures of several experiments, one a row
    <!--given thesis-->24.5<!--/given-->                          a figure nobody measured here; why: `GIVEN`
"""
