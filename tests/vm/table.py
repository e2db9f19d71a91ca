"""Print the results of the virtual machine as tables of Markdown."""

from __future__ import annotations

from typing import Any


def _head(found: dict[str, Any]) -> str:
    guest, host = found["guest"], found["host"]
    load = " to ".join(f"{host[key][0]:.1f}" for key in ("load_before", "load_after"))
    return (
        f"kernel {guest['kernel']}, PREEMPT_RT {guest['preempt_rt']}, {guest['cores']} cores by {host['accelerator']}; "
        f"host: {host['cores']} cores, load {load} (1 min), nice {host['nice']}\n"
    )


def scenario_table(found: dict[str, Any]) -> tuple[str, bool]:
    """Return the table of the scenarios, one row each, and whether all claims hold."""
    lines = [_head(found), "| what was done, the axis moving | measured | holds |", "|---|---|---|"]
    broken = []
    for scenario in found["scenarios"]:
        claims = scenario["claims"]
        failed = [claim for claim in claims if not claim["holds"]]
        measured = "; ".join(claim["measured"] for claim in claims if claim["measured"])
        verdict = f"{len(claims) - len(failed)} of {len(claims)}"
        lines.append(f"| {scenario['name']} | {measured} | {verdict} |")
        broken += [f"{scenario['name']}: {claim['text']}: {claim['measured'] or 'no'}" for claim in failed]
    lines += ["", f"{len(broken)} claims do not hold" if broken else "all claims hold", *broken]
    return "\n".join(lines), bool(found["scenarios"]) and not broken


def rates_table(found: dict[str, Any]) -> tuple[str, bool]:
    """Return the table of the rates and True: they are measured, not judged."""
    lines = [_head(found), *found["table"]]
    return "\n".join(lines), True
