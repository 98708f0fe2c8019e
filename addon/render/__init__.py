"""A final render: the engine class, its result, statistics, stamp and progress."""
