"""The outcome of a command as JUnit XML, as Jenkins, GitLab and the reporters of GitHub read it.

Elements and attributes are those of junit-10.xsd of the xUnit plugin of Jenkins. A case fails
where a gate is not met, a check contradicts or a finding makes the results wrong; it breaks where
a stage does; it is skipped where the data test nothing. The exit code knows gates and errors alone.
"""

from collections.abc import Sequence
from xml.etree import ElementTree

from auvident.schema.outcome import CommandOutcome, ResultCase
from auvident.schema.quoting import clipped, printable

ELEMENTS = {"failed": "failure", "error": "error", "skipped": "skipped"}
LONGEST = 2000  # characters of a text


def junit_bytes(outcome: CommandOutcome) -> bytes:
    """The file, one suite a group of cases."""
    groups = list(dict.fromkeys(case.group for case in outcome.cases))
    suites = [[c for c in outcome.cases if c.group == group] for group in groups]
    about = {"name": _text(outcome.command), **_counts(outcome.cases)}
    about.pop("skipped")  # suites alone have it
    root = ElementTree.Element("testsuites", about)
    for group, cases in zip(groups, suites, strict=True):
        root.append(_suite(group, cases, outcome.at))
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def _suite(group: str, cases: Sequence[ResultCase], at: str) -> ElementTree.Element:
    time = at.partition("+")[0]  # UTC: the schema knows no zones
    about = {"name": f"auvident.{group}", **_counts(cases), "timestamp": time}
    suite = ElementTree.Element("testsuite", about)
    suite.extend([_case(case) for case in cases])
    return suite


def _counts(cases: Sequence[ResultCase]) -> dict[str, str]:
    results = [case.result for case in cases]
    return {
        "tests": str(len(cases)),
        "failures": str(results.count("failed")),
        "errors": str(results.count("error")),
        "skipped": str(results.count("skipped")),
        "time": f"{sum(case.seconds for case in cases):.3f}",
    }


def _case(case: ResultCase) -> ElementTree.Element:
    element = ElementTree.Element(
        "testcase",
        classname=f"auvident.{case.group}",
        name=_text(case.name),
        time=f"{case.seconds:.3f}",
    )
    if case.result == "passed":
        if case.text:
            ElementTree.SubElement(element, "system-out").text = _text(case.text)
        return element
    about = {"message": _text(case.message)}
    if case.result != "skipped":
        about["type"] = _text(case.kind or case.group)
    found = ElementTree.SubElement(element, ELEMENTS[case.result], about)
    if case.text and case.text != case.message:
        found.text = _text(case.text)
    return element


def _text(text: str) -> str:
    """Text that XML can hold: what does not print, as codes; the rest is escaped when written."""
    return printable(clipped(text, LONGEST))
