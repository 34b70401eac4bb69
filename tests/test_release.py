"""Releases: one version everywhere, a changelog, a conda recipe, and workflows that call existing commands."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

import simdtex

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
WORKFLOWS = {path.stem: path for path in sorted((ROOT / ".github" / "workflows").glob("*.yml"))}
TARGETS = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))

RECIPE = ROOT / "conda" / "recipe.yaml"

CHECKOUT = pytest.mark.skipif(not (ROOT / ".ci").exists(), reason="a source distribution has no .ci")


def read(name):
    """A workflow; YAML 1.1 takes its key ``on`` for a truth value."""
    return yaml.safe_load(WORKFLOWS[name].read_text(encoding="utf-8"))


def steps(name):
    return [step for job in read(name)["jobs"].values() for step in job["steps"]]


def test_the_citation_is_that_of_the_project():
    assert CITATION["version"] == PROJECT["version"] == simdtex.__version__
    assert CITATION["title"] == PROJECT["name"]
    assert CITATION["license"] == PROJECT["license"]
    assert [author["name"] for author in CITATION["authors"]] == [author["name"] for author in PROJECT["authors"]]
    assert ("date-released" in CITATION) == (".dev" not in PROJECT["version"])
    assert CITATION.get("repository-code") == PROJECT.get("urls", {}).get("Repository")


def test_every_supported_python_is_tried():
    named = [line.rpartition(" ")[2] for line in PROJECT["classifiers"] if ":: Python :: 3." in line]
    assert read("ci")["jobs"]["all"]["strategy"]["matrix"]["python"] == named
    assert PROJECT["requires-python"] == f">={named[0]}"


def test_an_issue_begins_with_the_version():
    for name in ("bug", "wish"):
        form = yaml.safe_load((ROOT / ".github" / "ISSUE_TEMPLATE" / f"{name}.yml").read_text(encoding="utf-8"))
        version = next(field for field in form["body"] if field.get("id") == "version")
        assert {"name", "description", "body"} <= set(form)
        assert "`simdtex --version`" in version["attributes"]["label"] and version["validations"]["required"] is True


def test_the_changelog_knows_the_version_and_a_release_takes_three_steps():
    page = (ROOT / "docs" / "releasing.rst").read_text(encoding="utf-8")
    assert re.findall(r"^(\d)\. ", page, re.MULTILINE) == ["1", "2", "3"]
    headings = re.findall(r"^## \[(.+?)\]", CHANGELOG, re.MULTILINE)
    assert headings[0] == "Unreleased"
    assert ".dev" in PROJECT["version"] or PROJECT["version"] in headings


@CHECKOUT
def test_workflows_call_what_there_is_with_pinned_actions_and_their_jobs_end():
    for name in WORKFLOWS:
        runs = [step["run"] for step in steps(name) if "run" in step]
        targets = {target for run in runs for target in re.findall(r"\bmake ([a-z]+)", run)}
        files = {path for run in runs for path in re.findall(r"(?<![\w/])(\.ci/\w+|pyproject\.toml)", run)}
        assert (targets or files) and targets <= TARGETS and all((ROOT / path).exists() for path in files)
        for step in steps(name):
            if "uses" in step:
                assert re.fullmatch(r"[\w-]+/[\w-]+@(v\d+|[0-9a-f]{40}|release/v\d+)", step["uses"])
            if step.get("uses", "").startswith("actions/checkout@"):
                assert step["with"]["persist-credentials"] is False
        assert all(job["timeout-minutes"] <= 120 for job in read(name)["jobs"].values())
    called = set(re.findall(r"^make ([a-z]+)", (ROOT / ".ci" / "run").read_text(encoding="utf-8"), re.MULTILINE))
    assert called and called <= TARGETS


def test_nobody_may_write_but_the_index_trusts_one_job():
    assert read("ci")["permissions"] == {"contents": "read"}
    release = read("release")
    assert release["permissions"] == {}
    asked = {name: job["permissions"] for name, job in release["jobs"].items()}
    assert asked == {"build": {"contents": "read"}, "try": {}, "publish": {"id-token": "write"}}
    assert release[True] == {"push": {"tags": ["v*"]}}


def test_nothing_is_published_that_was_not_tried():
    jobs = read("release")["jobs"]
    assert set(jobs["publish"]["needs"]) == {"build", "try"}
    assert jobs["publish"]["environment"] == "pypi"
    assert [step["uses"].partition("@")[0] for step in jobs["publish"]["steps"]] == [
        "actions/download-artifact",
        "pypa/gh-action-pypi-publish",
    ]
    tried = jobs["try"]["strategy"]["matrix"]["include"]
    assert {each["os"].partition("-")[0] for each in tried} == {"ubuntu", "windows", "macos"}
    linux = [each["python"] for each in tried if each["os"].startswith("ubuntu")]
    assert linux == read("ci")["jobs"]["all"]["strategy"]["matrix"]["python"]


def test_the_conda_recipe_is_that_of_the_project():
    recipe = yaml.safe_load(RECIPE.read_text(encoding="utf-8"))
    assert recipe["context"]["version"] == PROJECT["version"]
    assert f">={recipe['context']['python_min']}" == PROJECT["requires-python"]
    assert recipe["about"]["license"] == PROJECT["license"]
    assert recipe["about"]["summary"] == PROJECT["description"]
    (script,) = recipe["build"]["python"]["entry_points"]
    assert dict([script.split(" = ")]) == PROJECT["scripts"]
    wanted = [" >=".join(line.split(">=")) for line in PROJECT["dependencies"]]
    assert sorted(recipe["requirements"]["run"][1:]) == sorted(wanted)


@pytest.mark.slow
def test_the_conda_recipe_renders():
    rattler_build = pytest.importorskip("rattler_build")
    recipe = rattler_build.Stage0Recipe.from_file(RECIPE)
    (variant,) = recipe.render(rattler_build.VariantConfig())
    assert (variant.recipe.package.name, variant.recipe.package.version) == (PROJECT["name"], PROJECT["version"])
