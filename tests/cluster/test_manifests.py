"""What deploy/ says to Kubernetes, Argo and Ray is valid, and its commands are those of this build."""
import pathlib
import re
import shutil
import subprocess

import pytest

from conftest import REPOSITORY

yaml = pytest.importorskip("yaml")
kubernetes_validate = pytest.importorskip("kubernetes_validate", reason="PyPI's kubernetes-validate has the schemas")

CLUSTER = REPOSITORY / "deploy/cluster"
KUBERNETES = CLUSTER / "kubernetes"
OVERLAYS = ["base", "gpu", "tls", "bulk"]
VERSION = "1.33"
# Of the Prometheus operator, not of Kubernetes itself: its schema is not among those.
OF_OTHERS = {"ServiceMonitor"}


def built(overlay):
    if not shutil.which("kubectl"):
        pytest.skip("kubectl, which has kustomize, is not installed")
    done = subprocess.run(["kubectl", "kustomize", KUBERNETES / overlay], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return list(yaml.safe_load_all(done.stdout))


def of_kind(objects, kind):
    (found,) = [each for each in objects if each["kind"] == kind]
    return found


@pytest.mark.parametrize("overlay", OVERLAYS)
def test_every_object_is_valid_to_the_letter(overlay):
    for each in built(overlay):
        if each["kind"] not in OF_OTHERS:
            kubernetes_validate.validate(each, VERSION, strict=True)


def test_a_misspelt_field_would_be_found():
    deployment = of_kind(built("base"), "Deployment")
    deployment["spec"]["template"]["spec"]["containers"][0]["readinessprobe"] = {}
    with pytest.raises(kubernetes_validate.ValidationError):
        kubernetes_validate.validate(deployment, VERSION, strict=True)


@pytest.mark.parametrize("overlay", OVERLAYS)
def test_pods_run_without_privileges(overlay):
    for each in built(overlay):
        if each["kind"] not in ("Deployment", "Job"):
            continue
        pod = each["spec"]["template"]["spec"]
        assert pod["securityContext"]["runAsNonRoot"] and pod["automountServiceAccountToken"] is False
        for container in pod["containers"]:
            assert container["securityContext"] == {
                "allowPrivilegeEscalation": False, "readOnlyRootFilesystem": True, "capabilities": {"drop": ["ALL"]}}


@pytest.mark.parametrize("overlay", ["base", "gpu", "tls"])
def test_selectors_find_the_pods_of_the_deployment(overlay):
    objects = built(overlay)
    labels = of_kind(objects, "Deployment")["spec"]["template"]["metadata"]["labels"].items()
    ports = {port["name"] for port in of_kind(objects, "Deployment")["spec"]["template"]["spec"]["containers"][0]["ports"]}
    assert of_kind(objects, "Service")["spec"]["selector"].items() <= labels
    assert {port["targetPort"] for port in of_kind(objects, "Service")["spec"]["ports"]} == ports
    assert of_kind(objects, "PodDisruptionBudget")["spec"]["selector"]["matchLabels"].items() <= labels
    assert of_kind(objects, "NetworkPolicy")["spec"]["podSelector"]["matchLabels"].items() <= labels
    assert of_kind(objects, "ServiceMonitor")["spec"]["selector"]["matchLabels"].items() <= \
        of_kind(objects, "Service")["metadata"]["labels"].items()
    assert of_kind(objects, "HorizontalPodAutoscaler")["spec"]["scaleTargetRef"]["name"] == \
        of_kind(objects, "Deployment")["metadata"]["name"]


def test_exit_codes_are_those_of_the_command_line():
    header = (REPOSITORY / "client/cli/common/exit_code.h").read_text()
    codes = {name: int(code) for name, code in re.findall(r"k(\w+) = (\d+)", header)}
    rules = of_kind(built("bulk"), "Job")["spec"]["podFailurePolicy"]["rules"]
    (failing,) = [rule for rule in rules if rule["action"] == "FailIndex"]
    assert failing["onExitCodes"]["values"] == [codes["BadInput"], codes["Refused"]]
    expression = yaml.safe_load((CLUSTER / "argo.yaml").read_text())["spec"]["templates"][1]["retryStrategy"]["expression"]
    assert [int(code) for code in re.findall(r"!= (\d+)", expression)] == failing["onExitCodes"]["values"]
    assert re.search(r"^UNREACHABLE = (\d+)", (CLUSTER / "ray_dataset.py").read_text(), re.MULTILINE).group(1) == \
        str(codes["Unreachable"])


def shard_commands():
    job = of_kind(built("bulk"), "Job")["spec"]
    workflow = yaml.safe_load((CLUSTER / "argo.yaml").read_text())["spec"]
    template = {each["name"]: each for each in workflow["templates"]}["shard"]
    return {"job": (job["template"]["spec"]["containers"][0]["args"], "$(JOB_COMPLETION_INDEX)", str(job["completions"])),
            "argo": ([word.replace("{{workflow.parameters.jobs}}", workflow["arguments"]["parameters"][0]["value"])
                      for word in template["container"]["args"]], "{{inputs.parameters.job}}",
                     workflow["arguments"]["parameters"][0]["value"])}


@pytest.mark.parametrize("of", ["job", "argo"])
def test_the_shard_command_writes_its_part(of, bin_folder, tmp_path):
    arguments, index, count = shard_commands()[of]
    assert f"{index}/{count}" in arguments
    # The same words with a smaller dataset: as many shards as jobs, of one sample.
    words = [word.replace(index, "3").replace("/data/training", str(tmp_path)).replace("1000000", count) for word in arguments]
    done = subprocess.run([bin_folder / "touchstone", *words, "--shard-size", "1"], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert [path.name for path in tmp_path.glob("shard-*")] == ["shard-000003.tar"]


def test_the_workflow_is_one_of_argo():
    models = pytest.importorskip("hera.workflows.models", reason="PyPI's hera has Argo's schema")
    text = yaml.safe_load((CLUSTER / "argo.yaml").read_text())
    models.Workflow.model_validate(text)
    text["spec"]["templates"][0]["steps"][0][0]["withSequence"]["count"] = [100]
    with pytest.raises(ValueError, match="count"):
        models.Workflow.model_validate(text)


@pytest.mark.parametrize("overlay,program", [("base", "touchstone-server"), ("tls", "touchstone-server")])
def test_flags_are_those_of_the_program(overlay, program, bin_folder):
    container = of_kind(built(overlay), "Deployment")["spec"]["template"]["spec"]["containers"][0]
    text = subprocess.run([bin_folder / program, "--help"], capture_output=True, text=True, timeout=60, check=False).stdout
    known = set(re.findall(r"--[a-z][a-z-]*", text))
    flags = {word for word in container["args"] if word.startswith("--")}
    assert flags and not flags - known


def test_ray_writes_the_dataset_of_one_process(bin_folder, tmp_path):
    python = REPOSITORY / "build/current_venv/bin/python"
    if not python.exists() or subprocess.run([python, "-c", "import ray"], capture_output=True, check=False).returncode != 0:
        pytest.skip("build/current_venv has no Ray; deploy/test python makes it")
    what = ["--samples", "600", "--shard-size", "100", "--image", "64x64", "--renderer", "cpu"]
    subprocess.run([bin_folder / "touchstone", "stream", *what, "--out", tmp_path / "one", "--quiet"], check=True, timeout=120)
    done = subprocess.run([python, CLUSTER / "ray_dataset.py", "--jobs", "3", "--program", bin_folder / "touchstone", "--",
                           *what, "--out", tmp_path / "ray"], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    files = {path.name: path.read_bytes() for path in pathlib.Path(tmp_path / "one").iterdir()}
    assert {path.name: path.read_bytes() for path in pathlib.Path(tmp_path / "ray").iterdir()} == files
