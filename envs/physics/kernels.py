# type: ignore  a kernel is in Warp's own language, whose arrays and vectors Python's types do not describe
"""Warp kernels around MuJoCo Warp's step: what bodies feel of the ground and of props, and worlds that diverge."""

import warp as wp

MAX_VALUE = wp.constant(1e10)
"""Coordinates and velocities beyond this have diverged: MuJoCo's own mjMAXVAL."""


@wp.func
def _is_bad(x: float) -> bool:
    return not (wp.abs(x) <= MAX_VALUE)  # nan compares false


@wp.kernel(enable_backward=False)
def feel(
    contacts: wp.array[int],
    contact_force: wp.array[wp.spatial_vector],
    contact_geom: wp.array[wp.vec2i],
    contact_world: wp.array[int],
    geom_body: wp.array[int],
    bodies: int,
    of_everything: bool,
    # out
    ground_force: wp.array2d[wp.vec3],
    hit_force: wp.array3d[wp.vec3],
):
    """Add up the contacts' forces on the character's bodies 1..B by the ground, body 0, and by props, B + 1 and on.

    A contact's force is that on its second geom. With `of_everything` the sum over all that touches the body, on what
    touches it, stands in place of the ground's force on it.
    """
    contact = wp.tid()
    if contact >= contacts[0]:
        return
    world = contact_world[contact]
    force = wp.spatial_top(contact_force[contact])
    for side in range(2):
        other = geom_body[contact_geom[contact][side]]
        body = geom_body[contact_geom[contact][1 - side]]
        on_body = wp.where(side == 0, force, -force)
        if body >= 1 and body <= bodies:
            if of_everything:
                wp.atomic_add(ground_force, world, body - 1, -on_body)
            elif other == 0:
                wp.atomic_add(ground_force, world, body - 1, on_body)
            if other > bodies:
                wp.atomic_add(hit_force, world, other - bodies - 1, body - 1, on_body)


@wp.kernel(enable_backward=False)
def keep_greatest(sample: wp.array3d[wp.vec3], greatest: wp.array3d[wp.vec3]):
    """Each axis' force of the greatest size so far; ready `sample` for the next substep."""
    world, prop, body = wp.tid()
    new, old = sample[world, prop, body], greatest[world, prop, body]
    kept = wp.vec3()
    for axis in range(3):
        kept[axis] = wp.where(wp.abs(new[axis]) > wp.abs(old[axis]), new[axis], old[axis])
    greatest[world, prop, body] = kept
    sample[world, prop, body] = wp.vec3()


@wp.kernel(enable_backward=False)
def heal(
    qpos0: wp.array2d[float],
    qpos_before: wp.array2d[float],
    qvel_before: wp.array2d[float],
    # in and out
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    ctrl: wp.array2d[float],
    qacc: wp.array2d[float],
    warmstart: wp.array2d[float],
    actuator_force: wp.array2d[float],
    time: wp.array[float],
    ground_force: wp.array2d[wp.vec3],
    hit_force: wp.array3d[wp.vec3],
    # out
    healed: wp.array[bool],
    count: wp.array[int],
    kept_qpos: wp.array2d[float],
    kept_qvel: wp.array2d[float],
    kept_ctrl: wp.array2d[float],
):
    """Put worlds whose state has diverged back to the model's defaults, and keep what they were before the step."""
    world = wp.tid()
    bad = bool(False)  # noqa: UP018 a variable of Warp's, not a constant
    for i in range(qpos.shape[1]):
        bad = bad or _is_bad(qpos[world, i])
    for i in range(qvel.shape[1]):
        bad = bad or _is_bad(qvel[world, i]) or _is_bad(qacc[world, i])
    for i in range(ctrl.shape[1]):
        bad = bad or _is_bad(ctrl[world, i])  # the engine would take nan for a limit of its range
    healed[world] = bad
    if not bad:
        return
    slot = wp.atomic_add(count, 0, 1) % kept_qpos.shape[0]
    for i in range(qpos.shape[1]):
        kept_qpos[slot, i] = qpos_before[world, i]
        qpos[world, i] = qpos0[world % qpos0.shape[0], i]
    for i in range(qvel.shape[1]):
        kept_qvel[slot, i] = qvel_before[world, i]
        qvel[world, i] = 0.0
        qacc[world, i] = 0.0
        warmstart[world, i] = 0.0
    for i in range(ctrl.shape[1]):
        kept_ctrl[slot, i] = ctrl[world, i]
        ctrl[world, i] = 0.0
        actuator_force[world, i] = 0.0
    time[world] = 0.0
    for body in range(ground_force.shape[1]):
        ground_force[world, body] = wp.vec3()
        for prop in range(hit_force.shape[1]):
            hit_force[world, prop, body] = wp.vec3()
