"""Files of other loggers: containers of many tables, one module a format.

A format is a row of `auvident.storage.readers.registry.READERS` and a module with an object that
follows `auvident.storage.readers.interface.LogReader`. A laboratory's own format needs no change
here: it comes as an entry point of the group ``auvident.readers``.
"""
