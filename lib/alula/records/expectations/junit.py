"""Checked expectations as JUnit XML, which every CI shows."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree as ET

from alula.records.expectations.checking import Checked


def junit(name: str, checked: Sequence[Checked]) -> str:
    """Return a test suite with a case for each expectation."""
    failed = sum(bool(one.problem) for one in checked)
    suite = ET.Element("testsuite", name=name, tests=str(len(checked)), failures=str(failed), errors="0", skipped="0")
    for one in checked:
        case = ET.SubElement(suite, "testcase", classname=one.place, name=one.expected)
        if one.problem:
            ET.SubElement(case, "failure", message=one.problem).text = str(one)
    root = ET.Element("testsuites")
    root.append(suite)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"
