"""Recordings for other tools: export to MF4, MCAP, CSV, .mat and HDF5, and back without a map.

step                 modules                                                     result
what a file gets     content                                                     `Content`: columns, metadata, start
formats              mdf_file, mcap_file, csv_file, mat_file, hdf5_file          a file
layout of a viewer   plotjuggler                                                 XML
choice of a format   export                                                      `export_recording`
back                 own_file                                                    `Recording`
frames of a bus      can_frames, bus_log                                         `Recording`

Foreign files of these formats are read by `hil.importing`; an own one is known by its metadata.
"""
