def cases_behind(wildcards):
    """How many cases a study has that a path names; 0 for a path without one."""
    return len(PLAN.sources(wildcards.study)) if "study" in wildcards.keys() else 0


def memory_of(script):
    """What a script asks a cluster for in MiB, as a function of wildcards and attempt."""

    def memory(wildcards, attempt):
        case = case_of(wildcards) if "case" in wildcards.keys() else None
        return script_memory(script, attempt, case, cases_behind(wildcards))

    return memory


def minutes_of(script):
    """The same in minutes."""

    def minutes(wildcards, attempt):
        return script_minutes(script, attempt, cases_behind(wildcards))

    return minutes


def predicted_seconds(wildcards):
    """CPU time that a case will take."""
    return round(planned_for(wildcards.case).costs.get(wildcards.case, 0))


def memory_to_solve(wildcards, attempt):
    """What solving a case asks a cluster for in MiB."""
    return solve_memory(case_of(wildcards), attempt)


def minutes_to_solve(wildcards, attempt):
    """The same in minutes."""
    return solve_minutes(predicted_seconds(wildcards), attempt)


def minutes_to_time(wildcards, attempt):
    """The same where it is solved again, a few times at most."""
    return 3 * minutes_to_solve(wildcards, attempt)


def begin():
    """What happens between planning and the first job: a sweep that cannot end well is refused, jobs are handed the plan."""
    from limo.cluster.begin import begin_sweep

    try:
        begin_sweep(workflow, PROJECT, PLAN)
    except LimoError as error:
        raise WorkflowError(str(error)) from None
