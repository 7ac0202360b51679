"""The judge's part of a page: verdict, what failed and when, every check with what it means, limits that were loosened."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree.ElementTree import Element

import numpy as np

from dexplan.page.html import Child, build, build_facts, build_picture, build_section, build_table
from dexplan.page.pictures import MOST_MOMENTS, Pictures
from dexplan.page.subject import Subject, name_action
from dexplan.sim.judge.groups import GROUPS
from dexplan.sim.judge.limits import is_floor
from dexplan.sim.judge.report import CheckResult, ValidationReport
from dexplan.viz.check_words import (
    FAILED,
    GROUP_QUESTIONS,
    PASSED,
    UsedLimit,
    describe_check,
    list_used_limits,
    spell,
    spell_beside,
    spell_limit,
)
from dexplan.viz.curves import Curves
from dexplan.viz.figure import describe_verdict
from dexplan.viz.timeline import read_finger_names

SIGNS = {PASSED: "✓ pass", FAILED: "✗ fail"}
"""What stands before a check, so that nobody has to tell colours apart; any other status stands in its own words."""


def build_verdict(subject: Subject) -> Element:
    """Return the answer in a sentence, and what has to be said beside it."""
    report, plan = subject.report, subject.plan
    if report is None:
        refused = [
            build("strong", f"⊘ REFUSED {plan.status}"),
            build("p", f"{plan.status.meaning[:1].upper()}{plan.status.meaning[1:]}."),
        ]
        return build("div", refused, class_="verdict refused", id="verdict")
    head, _, rest = describe_verdict(report).partition(": ")
    words: list[Child] = [build("strong", head), build("p", rest) if rest else None]
    failure = subject.trace.meta.get("failure") if subject.trace is not None else None
    if failure:
        words.append(build("p", f"The run was cut short: {failure}"))
    box = build("div", words, class_=f"verdict {'pass' if report.is_passed else 'fail'}", id="verdict")
    said = [build("p", text) for text in report.reservations]
    return build(
        "div",
        box,
        build("div", build("strong", "To be read with this: "), *said, class_="alert") if said else None,
    )


def list_moments(subject: Subject) -> dict[str, float]:
    """Return the failing checks that name their worst moment, and that moment [s]."""
    if subject.report is None or subject.trace is None:
        return {}
    failed = [check for check in subject.report.failures if check.worst_time_s is not None]
    return {check.name: float(check.worst_time_s or 0.0) for check in failed[:MOST_MOMENTS]}


def build_failures(subject: Subject, pictures: Pictures, curves: Curves | None) -> Element | None:
    """Return a card per failing check: what it means, by how much it failed, and the moment where it was worst."""
    if subject.report is None or not subject.report.failures:
        return None
    moments, cards = list_moments(subject), []
    for check in subject.report.failures:
        words = describe_check(check.name)
        parts: list[Child] = [
            build("h3", f"✗ {words.title} ", build("code", check.name, class_="name")),
            build("p", words.meaning),
            build("p", _spell_value(check)),
        ]
        if check.note:
            parts.append(build("p", f"The judge notes: {check.note}", class_="note"))
        time = moments.get(check.name)
        if time is not None:
            parts.append(_tell_moment(subject, time))
            picture = pictures.get(time)
            if picture is not None:
                parts.append(
                    build_picture(
                        picture, f"The hand at {time:.2f} s, the worst moment of {words.title}", "jpeg"
                    )
                )
            if curves is not None:
                parts.append(_build_contacts(subject, curves, time))
        cards.append(build("div", parts, class_="card fail", id=f"moment-{check.name}"))
    return build_section("failures", "What failed, and when", cards)


def _spell_value(check: CheckResult) -> str:
    value = (
        "There is no value"
        if check.value is None
        else f"Measured {spell_beside(check.value, check.limit, check.unit)}"
    )
    if check.limit is None:
        return f"{value}."
    return f"{value}; the limit is {spell_limit(check.limit, check.unit)}."


def _tell_moment(subject: Subject, time: float) -> Element:
    index = subject.find_action(time)
    if index is None:
        return build("p", f"Worst at {time:.2f} s.")
    action = build("a", f"action {index + 1}", href=f"#{name_action(index)}")
    return build("p", f"Worst at {time:.2f} s, in ", action, ":")


def _build_contacts(subject: Subject, curves: Curves, time: float) -> Element | None:
    """Return what each contact did at a moment."""
    if subject.trace is None or not len(curves.time):
        return None
    sample = int(np.argmin(np.abs(curves.time - time)))
    rows = []
    for finger in range(len(read_finger_names(subject.trace))):
        touches = bool(subject.trace["contact_active"][sample, finger])
        numbers = (curves.normal_force[sample, finger], curves.normal_force_reference[sample, finger])
        measured, planned = (spell(float(x), "N") if np.isfinite(x) else "" for x in numbers)
        used = float(curves.utilisation[sample, finger])
        share = spell(used) if np.isfinite(used) else ""
        rows.append((f"finger {finger + 1}", "yes" if touches else "no", measured, planned, share))
    heads = ("finger", "touches", "normal force", "planned", "friction used")
    return build_table(heads, rows)


def build_checks(subject: Subject) -> Element | None:
    """Return every check, by group, with what it means, its value beside its limit, and where its worst moment is."""
    report = subject.report
    if report is None:
        return None
    used = {item.name: item for item in list_used_limits(report)}
    counts = {
        status: sum(c.status == status for c in report.checks) for status in {c.status for c in report.checks}
    }
    told = ", ".join(f"{counts[s]} {s.replace('_', ' ')}" for s in sorted(counts, key=_rank_status))
    moments = list_moments(subject)
    parts: list[Child] = [
        build(
            "p",
            f"The judge replays the recorded controls and measures again. {len(report.checks)} checks: {told}.",
        ),
        build(
            "p",
            "A bar shows how much of its limit a check used; the line at its right end is the limit.",
            class_="note",
        ),
    ]
    known = {name for names in GROUPS.values() for name in names}
    groups = {**GROUPS, "others": tuple(c.name for c in report.checks if c.name not in known)}
    by_name = {check.name: check for check in report.checks}
    for group, names in groups.items():
        checks = [by_name[name] for name in names if name in by_name]
        if not checks:
            continue
        parts.append(
            build("h3", f"{group.capitalize()}: {GROUP_QUESTIONS.get(group, 'What else was judged?')}")
        )
        heads = ("check", "status", "value", "limit", "of its limit", "worst at")
        table = build_table(
            heads,
            (_build_row(subject, c, used.get(c.name), c.name in moments) for c in checks),
            class_="cards",
        )
        for row, check in zip(table.iterfind("tbody/tr"), checks, strict=True):
            row.set("class", check.status.replace("_", "-"))
            row.set("id", f"check-{check.name}")
        parts.append(table)
    return build_section("checks", "Every check", parts)


def _rank_status(status: str) -> tuple[int, str]:
    return ([FAILED, PASSED].index(status) if status in (FAILED, PASSED) else 2), status


def _build_row(
    subject: Subject, check: CheckResult, used: UsedLimit | None, has_moment: bool
) -> list[Child | Iterable[Child]]:
    words = describe_check(check.name)
    name: list[Child] = [
        words.title,
        " ",
        build("code", check.name, class_="name"),
        build("p", words.meaning, class_="meaning") if words.meaning else None,
        build("p", f"Note: {check.note}", class_="note") if check.note else None,
    ]
    status = build("span", SIGNS.get(check.status, f"– {check.status.replace('_', ' ')}"), class_="status")
    value = "" if check.value is None else spell_beside(check.value, check.limit, check.unit)
    limit, bar = "", None
    if used is not None:
        limit = f"at {'least' if used.is_least else 'most'} {spell_limit(used.limit, used.unit)}"
        width = f"{100.0 * min(max(used.share, 0.0), 1.0):.0f}%"
        label = f"{100.0 * used.share:.0f} % of its limit" if np.isfinite(used.share) else "beyond its limit"
        bar = build(
            "span",
            build("span", style=f"width:{width}"),
            class_="bar",
            role="img",
            aria_label=label,
            title=label,
        )
    elif check.limit is not None:
        limit = f"at most {spell_limit(check.limit, check.unit)}"
    return [name, status, value, limit, bar, _link_moment(subject, check, has_moment)]


def _link_moment(subject: Subject, check: CheckResult, has_moment: bool) -> Child:
    """Return the worst moment as a link: of a failing check to its picture, of any other to the action that held then."""
    if check.status == FAILED and not has_moment:
        return build("a", "see above", href=f"#moment-{check.name}")
    if check.worst_time_s is None:
        return None
    words = f"{check.worst_time_s:.2f} s"
    if check.status == FAILED:
        return build("a", words, href=f"#moment-{check.name}")
    index = subject.find_action(check.worst_time_s)
    return words if index is None else build("a", words, href=f"#{name_action(index)}")


def build_loose_limits(report: ValidationReport | None) -> Element | None:
    """Return the limits that this run was judged by and that are looser than usual."""
    if report is None or not report.loose_limits:
        return None
    rows = [
        (build("code", name), f"{x['value']:g}", f"{x['default']:g}", "least" if is_floor(name) else "most")
        for name, x in report.loose_limits.items()
    ]
    table = build_table(("limit", "here", "usual", "kind"), rows)
    return build_section("limits", "Loosened limits", build("p", "A pass here says less than usual."), table)


def build_refusal(subject: Subject) -> Element:
    """Return what stood in the way, what it follows from, and what would help."""
    plan = subject.plan
    parts: list[Child] = [build("p", plan.reason or plan.status.meaning)]
    refusal = plan.refusal
    if refusal is not None:
        facts: list[tuple[Child, Child]] = [("kind of refusal", build("code", refusal.kind.value))]
        if refusal.subject:
            facts.append(("about", ", ".join(refusal.subject)))
        if refusal.measured is not None and refusal.needed is not None:
            data = refusal.as_dict()
            facts.append(("measured", spell(data["measured"], data["unit"])))
            facts.append(("needed", spell_limit(data["needed"], data["unit"])))
        if refusal.cure is not None:
            tried = " (tried: it helps)" if refusal.cure.is_checked else ""
            facts.append(("what would help", f"{refusal.cure}{tried}"))
        parts.append(build_facts(facts))
        if refusal.because:
            parts.append(build("p", "It follows from:"))
            parts.append(build("ul", (build("li", str(cause)) for cause in refusal.because)))
    return build_section("refusal", "Why there is no plan", parts)
