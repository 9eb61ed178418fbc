"""What a skillset is and what its steps do: the model as plain values, and its execution semantics as pure functions.

``model`` has the values and ``expressions`` their conditions, ``json_form`` writes and reads both as JSON. ``semantics`` takes every
step of a running skillset, and ``steps`` lists those that are possible in a situation. The language reads into this package, the
proofs and the managers take their steps with it. It imports nothing but ``common``.
"""
