"""The native core through its C interface: the only caller of the core's library. A call into the
core releases the GIL; the core works on threads of its own. `binding.py` loads the library;
`packing….py` turn values into its structures; `render.py live.py queries.py programs.py` are what
others call.
"""
