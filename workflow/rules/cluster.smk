REQUESTS = Requests(PLAN, case_of, lambda case_id: planned_for(case_id).costs)
memory_of, minutes_of = REQUESTS.memory_of, REQUESTS.minutes_of


def begin():
    """What happens between planning and the first job: a sweep that cannot end well is refused, jobs are handed the plan."""
    from limo.cluster.begin import begin_sweep

    try:
        begin_sweep(workflow, PROJECT, PLAN)
    except LimoError as error:
        raise WorkflowError(str(error)) from None
