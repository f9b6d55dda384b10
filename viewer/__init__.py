"""The character on a page of the browser, steered while it is simulated (`murmillo play`).

`pilots` act, `session` is what can be told and seen, `loop` keeps real time; none of them knows a browser. `shapes`
makes meshes of a MuJoCo model; `scene` and `page` show them, and the controls, through viser (the extra `play`).
"""
