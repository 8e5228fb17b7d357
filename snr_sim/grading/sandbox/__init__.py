"""The walls around a student's process, and what they are for: the threat model of grading.

**Who attacks.** The author of a submission. Any code may run in its process, Python or machine code, from the moment
the submission is read; it knows the kit, the labs and these walls. Accidents (a loop without an end, a leak) are
attacks without intent.

**What is protected.** The secret, seeds and hidden cases; verdicts and results; snr_sim, the grader's process, and
submissions, programs and results of others; the computer's availability and speed for further grading; the network.
Answers of a process are not trusted, in any isolation: `remote/` bounds them and never unpickles them.

**By which wall.** In the "sandbox" (`sandbox.py`, bubblewrap's namespaces) or "confined" (`confiner.py`,
`confinement.py`: a process of root's in an ordinary container walls itself in), both with `child_limits.py`:

    Attack on                    sandbox                              confined
    files of the grader, others  not shown; the rest is read-only     Landlock: all else cannot be opened
    labs of an installed kit     covered                              left out of what Landlock grants
    other processes              PID namespace, no /proc; filter      filter, Landlock on /proc, a user of its own
    root's rights                user nobody; few rights before       a user of its own, no new privileges
    network, unnamed sockets     network namespace; filter            filter
    what cases leave in memory   IPC namespace; filter                filter
    kernel: keys, cores, traces  filter                               filter
    processes, threads           limit of processes; filter           limit of processes; filter
    CPU time, memory, open files limits; cores dumped: none           limits; cores dumped: none
    disk                         16 MB in memory                      16 files of 1 MB, counted by the grader
    orphans                      end with the namespace and grader    there are none; ends with the grader

"Filter" is seccomp's (`seccomp.py`): a list of system calls that are allowed. Each wall is the
kernel's own. If one cannot be set up, the process ends before it reads the submission, and grading refuses. Where two
walls cover the same attack, tests remove the filter and try the other alone.

**Not covered.** Faults of the kernel, of bubblewrap and of the processor (side channels). A confined process can ask
whether a file exists, and see the container's `/`. A process can slow others within its CPU time, by the caches and
the memory bus that they share. Isolation "none" (practice, `snr check`) has no walls: there a program may do what its
author may do.
"""
