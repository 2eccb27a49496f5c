/* The functions of the Python module, as FUNCTION(name, arguments, what it does): one file for each part of the core. */

/* distribution.c */
FUNCTION(solve_packed, "(packed, tensions, direction=None)",
         "Solve a packed problem; return its status and fill tensions (m,) if optimal, direction (n,) if out of reach.")
FUNCTION(solve_rows,
         "(n, m, rho, in_lanes, A, w, t_min, t_max, t_ref, weights, length, per, tensions, direction, info, residual, "
         "status)",
         "Solve the rows of a batch whose status is UNSURE; return how many of all are optimal.")

/* available_wrench.c */
FUNCTION(facets, "(A, low, high, normals, least, most)",
         "Compute normals orthogonal to n - 1 columns, and the least and the most that tensions give along them.")
FUNCTION(margins, "(A, w, low, high, margins, reserves)",
         "Compute capacity margins, and the reserves along all normals unless None; w has as many rows, or one.")
FUNCTION(full_rank, "(n, tolerance, A, full)", "Find whether matrices of n rows have n independent columns, 1 or 0.")

/* mechanics.c */
FUNCTION(lines, "(robot, poses, carriers, lengths, A, J, anchors, sensitivity)",
         "Compute the lines of the cables at each pose, of those results that are not None; carriers has as many rows "
         "or one.")
FUNCTION(required_wrench, "(robot, poses, velocities, accelerations, wind, w)",
         "Compute the wrench that each motion needs; wind has as many rows, or one, or is None.")
FUNCTION(ends, "(robot, poses, carriers, anchors, attachments)", "Compute where the cables end at each pose.")
FUNCTION(cable_distances, "(robot, poses, carriers, distances)",
         "Compute the distances of all pairs of cables at each pose.")
FUNCTION(columns_by_geometry, "(robot, poses, carriers, S)",
         "Compute the columns of the wrench matrix with respect to anchors, attachments and radii, (m, 6, 7) a row.")
FUNCTION(wrench_by_pose, "(robot, poses, carriers, tensions, D)",
         "Compute the wrench of constant tensions with respect to the pose, (6, 6) a row.")
FUNCTION(wrench_by_axes, "(robot, poses, carriers, tensions, D)",
         "The same with respect to displacements of the CoM and turns about it, along and about the axes of {G}.")

/* pose.c */
FUNCTION(pose_from_lengths, "(robot, carriers, lengths, weights, free, damping, poses, errors, steps)",
         "Move poses to where the errors of their lengths are least; carriers has as many rows or one.")
FUNCTION(pose_covariance, "(robot, carriers, weights, poses, covariances)",
         "Compute how the noise of the lengths spreads each pose; carriers has as many rows or one.")
FUNCTION(one_pose_from_lengths, "(robot, carriers, lengths, sigma, pose, residuals, covariance)",
         "Move one pose to where the errors of its lengths are least, with its residuals and its covariance; return "
         "whether it ended at a minimum.")

/* horizon.c */
FUNCTION(horizon_size, "(N, n, m, p)",
         "Return how many numbers of memory a horizon of N stages, n states, m controls and p soft rows needs.")
FUNCTION(horizon_places, "(N, n, m, p, memory)", "Return where in memory the arrays of problem and solution begin.")
FUNCTION(horizon_relative_to, "(N, n, m, p, processor, states, controls, memory)",
         "Write the same problem in differences from a reference.")
FUNCTION(horizon_solve, "(N, n, m, p, processor, beginning, iterations_max, tolerance, memory, residuals)",
         "Solve the problem in memory; return how many iterations it took, and whether it converged.")

/* control.c */
FUNCTION(control_step,
         "(dt, since, length, distance, angle, solves, state, reference, robot, controller, late, measured, wanted, "
         "carriers, cables, platform, memory, problems)",
         "Take a state and a reference unless they are None, update the memory of each row, write the problem of "
         "tension distribution of this step, and solve it if `solves` is 1, or 2: in lanes; if it is -1, only take "
         "them. Return how many cables count as cut, how many rows are optimal, and how many may be so far from their "
         "reference.")
FUNCTION(control_thrusts,
         "(dt, robot, controller, measured, carriers, tensions, cables, platform, memory, turning, actuation)",
         "Write the commands of the actuators of flying carriers; return the most that a thrust lacks [N].")
FUNCTION(control_move_on, "(dt, robot, disturbance, tensions, actuation, accelerations, measured)",
         "Move motions that were measured earlier on, with the tensions (parts, N, m) since.")

/* stages.c */
FUNCTION(control_stages, "(robot, freed, tethers, steps, disturbance, carriers, states, controls, A, B, c)",
         "Write the dynamics of stages to first order about states and controls.")
FUNCTION(control_aim, "(length, A, B, c, steps, efforts, wanted, planned)",
         "Change a reference the least so that the platform obeys the dynamics of stages.")
FUNCTION(control_coordinates, "(robot, tethers, motions, coordinates)",
         "Compute the coordinates that tethers leave carriers, and two derivatives over time.")
FUNCTION(control_carriers, "(robot, tethers, motion, carriers)",
         "Compute how carriers move if the platform and those coordinates do.")

/* plant.c */
FUNCTION(run_plant, "(robot, settings, states, commands, history, tensions, means, steps, period, substeps, keep)",
         "Run each state under its commands, and write every keep-th state and its tensions, and mean tensions.")
FUNCTION(sense, "(robot, states, motions, lengths)",
         "Write the motions of platform and carriers in states of a plant, and lengths of the cables with their rates.")
FUNCTION(winch_forces, "(robot, settings, states, commands, period)",
         "Replace the tensions in commands of a plant by the forces of motors that give them.")
FUNCTION(winch_lengths, "(robot, states, lengths, tensions, last, commands, period)",
         "Write the unstrained lengths that give tensions within a period into commands of a plant.")
