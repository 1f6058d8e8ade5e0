#!/usr/bin/env python3
"""The Deployment among Kubernetes objects on standard input, for `podman kube play` on this machine: one pod, with an image
that is here, its port on PORT, and without the flags that this build does not know.

    kubectl kustomize deploy/cluster/kubernetes/base | pod_for_podman.py IMAGE PORT FILE-WITH-HELP-OF-THE-PROGRAM
"""
import pathlib
import sys

import yaml

image, port, help_file = sys.argv[1:]
known = pathlib.Path(help_file).read_text()
(deployment,) = [each for each in yaml.safe_load_all(sys.stdin) if each["kind"] == "Deployment"]
deployment["spec"]["replicas"] = 1
pod = deployment["spec"]["template"]["spec"]
(container,) = pod["containers"]
container.update(image=image, imagePullPolicy="Never")
arguments, kept = container["args"], []
for index, word in enumerate(arguments):
    flag = word if word.startswith("--") else arguments[index - 1]
    if f"{flag} " in known or f"{flag}\n" in known:
        kept.append(word)
container["args"] = kept
container["ports"] = [{"containerPort": 50051, "hostPort": int(port)}]
for volume in pod["volumes"]:
    volume.get("emptyDir", {}).pop("sizeLimit", None)  # which podman 4.3 does not know
yaml.safe_dump(deployment, sys.stdout)
