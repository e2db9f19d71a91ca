"""From a foreign file to a recording, in one direction. Without a map, `draft_map` writes one first.

step                 modules                                                     result
text to rows         number_form, cell_units, text_lines, text_rows              `TextRows`
                     encodings, listed_names, header_rows, csv_dialect           `Header`, `CsvDialect`
rows of one value    series_columns (which columns), series (put together)       `SeriesColumns`, `SeriesRows`
file to groups       mdf_file, hdf5_file, mcap_file, tdms_file, ulog_file        `Group`: channels of one clock
groups to variables  channel_groups                                              arrays by name, of one length
file to variables    mat_size, mat_file, variables                               arrays by name
file to records      long_text, records; hil.files.json_columns, xml_records     `Records`
file to table        row_groups, foreign_table (all columns)                     `ForeignTable`
                     foreign_columns (those that a map names)                    `Foreign`
words                lexicon(.yaml), units, column_names, unit_lines,            `Label`, `HeaderValue`
                     header_values, stated
clock                stamp_columns, row_counters, clock;                         `StampClock`, `RegularRows`
                     hil.recording.stamps and row_clock
                     channel_clocks (stamps of each channel)                     `OwnClocks`
values that hold     on_change                                                   columns without empty cells
rows                 wraps, held_samples, spikes, slow_gaps, rows                `KeptRows`
roles                relations, computed_position, two_encoders, effort_roles,   `Roles`
                     one_axis, unnamed_columns, monitor_outputs, roles
refusal              damage                                                      InputError, notes
units and signs      unit_choice, usual_values, encoder_counts, position_units,  entries of the map
                     effort_entry, speed_unit, channel_entries
map                  map_file (its keys), questions, map_draft, draft_map,       `MapDraft`, the YAML file
                     map_text
loggers of one run   joined_logs                                                 one .csv of all channels
recording            by_map                                                      `Recording`

A drafted map is applied like any other: `by_map` knows nothing of how it came about.
"""
