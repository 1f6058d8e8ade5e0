#!/usr/bin/env python3
"""Makes image sets, has `touchstone diagnose` report on them, marks the reports, prints the table."""
import argparse
import concurrent.futures
import dataclasses
import json
import math
import pathlib
import random
import resource
import shutil
import subprocess
import sys
import tempfile
import time

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import arms as all_arms
import judge
import sets

ROOT = pathlib.Path(__file__).resolve().parents[3]
LIMIT_S = 600


def diagnose(program, folder, model, meshes, out):
    """The report, seconds, seconds of all processors, and what the program said; the report is None if there is none."""
    report = pathlib.Path(out)
    command = [str(program), "diagnose", str(folder), "--model", str(model), "--mesh-dir", str(meshes), "--json",
               str(report), "--save-model", str(report.with_suffix(".better.yaml"))]
    began, used = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)
        said = done.stderr[-2000:]
    except subprocess.TimeoutExpired:
        said = f"no answer after {LIMIT_S} s"
    seconds, now = time.monotonic() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = now.ru_utime + now.ru_stime - used.ru_utime - used.ru_stime
    if not report.exists():
        return None, seconds, cpu, said
    return json.loads(report.read_text()), seconds, cpu, said


def falls_as_said(program, folder, report, meshes, out):
    """Whether `compare` with the improved model finds the error that the report says, within 5 %."""
    better = pathlib.Path(out).with_suffix(".better.yaml")
    final = float(judge.of_photographs(report).get("final", {}).get("rmse") or "nan")
    if not report.get("steps") or not better.exists():
        return True
    found = pathlib.Path(out).with_suffix(".compared.json")
    subprocess.run([str(program), "compare", str(folder), "--model", str(better), "--mesh-dir", str(meshes), "--json",
                    str(found)], capture_output=True, timeout=LIMIT_S, check=False)
    if not found.exists():
        return False
    rmse = float(judge.of_photographs(json.loads(found.read_text())).get("initial", {}).get("rmse", math.inf))
    return abs(rmse / final - 1) <= 0.05


def run_one(job):
    arm_index, number, seeds, program, keep, common = job
    arm = all_arms.ARMS[arm_index]
    seed = all_arms.seed_of(arm, number, seeds)
    with tempfile.TemporaryDirectory() as temporary:
        base = pathlib.Path(keep or temporary)
        base.mkdir(parents=True, exist_ok=True)
        folder = base / f"{arm.name.replace(' ', '_').replace('_+_', '+')}-{seed}"
        files = arm.make(seed)
        sets.write_set(files, folder)
        meshes, model = pathlib.Path(common) / "meshes", pathlib.Path(common) / "nominal.yaml"
        report_file = folder.with_suffix(".report.json")
        for old in (report_file, report_file.with_suffix(".better.yaml"), report_file.with_suffix(".compared.json")):
            old.unlink(missing_ok=True)
        report, seconds, cpu, said = diagnose(program, folder, model, meshes, report_file)
        truth = dataclasses.asdict(files.truth)
        mark = judge.judge(report, truth, seconds)
        mark.cpu_seconds = cpu
        if report is not None and not falls_as_said(program, folder, report, meshes, report_file):
            mark.missed_fall = True
            mark.confidently_wrong = True
            mark.right = mark.honest = False
    return arm.name, arm.group, seed, truth, mark, "" if report is not None else said


TARGETS: dict[str, list[tuple]] = {  # group -> (figure, target in %, whether at most)
    "nothing": [("false claim", 1, True)],
    "noise": [("false claim", None, True)],
    "weak": [("right first", 88, False), ("none added", None, False), ("confidently wrong", None, True)],
    "realistic": [("right first", 97, False), ("none added", None, False), ("within 1.1 of the floor", None, False),
                  ("confidently wrong", None, True)],
    "pairs": [("right first", None, False), ("none added", None, False), ("within 1.1 of the floor", None, False),
              ("confidently wrong", None, True)],
    "albedo": [("right", None, False), ("confidently wrong", None, True)],
    "unlisted": [("right", None, False), ("confidently wrong", 2, True)],
    "data errors": [("right", None, False), ("confidently wrong", None, True)],
}
FIGURES = {
    "false claim": lambda m: m.false_claim,
    "right first": lambda m: m.right_first,
    "none added": lambda m: m.all_found,
    "confidently wrong": lambda m: m.confidently_wrong,
    "within 1.1 of the floor": lambda m: m.over_floor <= judge.OVER_FLOOR,
    "right": lambda m: m.right,
}


def share(hits, count):
    low, high = judge.interval(hits, count)
    return f"{100 * hits / count:.3g}", f"{100 * low:.3g} - {100 * high:.3g}"


def table(results):
    lines = ["| arm | measure | target, % | sets | diagnose, % | 95 % interval | |", "| --- | --- | --- | --- | --- | --- | --- |"]

    def row(arm, figure, target, at_most, hits, count):
        if count == 0:
            return
        rate, bounds = share(hits, count)
        goal = "" if target is None else ("<= " if at_most else ">= ") + str(target)
        passed = target is None or (100 * hits / count <= target if at_most else 100 * hits / count >= target)
        lines.append(f"| {arm} | {figure} | {goal} | {count} | {rate} | {bounds} | "
                     f"{'' if target is None else 'pass' if passed else '**miss**'} |")

    for group, figures in TARGETS.items():
        marks = [r[4] for r in results if r[1] == group]
        for figure, target, at_most in figures:
            row(group, figure, target, at_most, sum(FIGURES[figure](m) for m in marks), len(marks))
    covered = [c for r in results for c in r[4].covered]
    if covered:
        rate, bounds = share(sum(covered), len(covered))
        passed = 92 <= 100 * sum(covered) / len(covered) <= 98
        lines.append(f"| all steps named rightly | interval covers | 92 to 98 | {len(covered)} values | {rate} | {bounds} | "
                     f"{'pass' if passed else '**miss**'} |")
    missed = sum(r[4].missed_fall for r in results)
    row("all", "error found again by compare", 100, False, len(results) - missed, len(results))
    reports = sum(r[4].report for r in results)
    row("all", "a report", 100, False, reports, len(results))
    seconds = sorted(r[4].seconds for r in results)
    lines.append("")
    cpu = sorted(r[4].cpu_seconds for r in results)
    for what, values in (("Seconds by the clock", seconds), ("Seconds of all processors", cpu)):
        lines.append(f"{what} for a diagnosis of 100 pictures: median {np.median(values):.1f}, 90 % within "
                     f"{values[int(0.9 * (len(values) - 1))]:.1f}, longest {values[-1]:.1f}"
                     f"{' (target 20)' if values is seconds else ''}.")
        lines.append("")
    lines += ["", "| set of arms | sets | right, % | honest, % | confidently wrong, % |", "| --- | --- | --- | --- | --- |"]
    for name in dict.fromkeys(r[0] for r in results):
        marks = [r[4] for r in results if r[0] == name]
        cells = [f"{a} ({b})" for a, b in (share(sum(f(m) for m in marks), len(marks))
                                          for f in (lambda m: m.right, lambda m: m.honest, lambda m: m.confidently_wrong))]
        lines.append(f"| {name} | {len(marks)} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def earlier(file):
    """What an interrupted run has written to --results."""
    lines = pathlib.Path(file).read_text().splitlines() if file and pathlib.Path(file).exists() else []
    rows = [json.loads(line) for line in lines]
    return [(r["arm"], r["group"], r["seed"], r["truth"], judge.Mark(**r["mark"]), r["said"]) for r in rows]


def words_before(done, asked, resumed):
    whole = sum(arm.sets for arm in all_arms.ARMS)
    words = f"{done} sets of the {whole} of a whole run."
    if resumed:
        words += f" {resumed} of them are of the same run before it was interrupted."
    if done < asked:
        words += f" {asked} were asked for; the time was up."
    if done < whole:
        words += (" So few sets give wide intervals: a rate of 0 or 100 % among n sets is known to about 3.7 / n, and a"
                  " target that is met or missed here may not be so in a whole run.")
    return words + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", default=ROOT / "build/release/bin/touchstone")
    parser.add_argument("--seeds", choices=all_arms.SEEDS, default="tuning")
    parser.add_argument("--share", type=float, default=1.0, help="of the sets of each arm; at least one each")
    parser.add_argument("--first", type=int, default=0, help="number of the first set of each arm: others are other seeds")
    parser.add_argument("--minutes", type=float, help="no set is begun later than so long after the start")
    parser.add_argument("--arm", action="append", default=[], help="only arms whose name or group holds this; repeatable")
    parser.add_argument("--threads", type=int, default=1, help="sets at once")
    parser.add_argument("--keep", help="folder for sets, truths and reports; default: they are removed")
    parser.add_argument("--results", help="append a line of JSON for each set to this file")
    parser.add_argument("--resume", action="store_true", help="count what --results holds already; the program must be the same")
    parser.add_argument("--verbose", action="store_true", help="a line for each set (tuning seeds only)")
    options = parser.parse_args()
    if options.verbose and options.seeds != "tuning":
        parser.error("--verbose: single sets are looked at on tuning seeds only")
    common = options.keep or tempfile.mkdtemp()
    sets.write_meshes(pathlib.Path(common) / "meshes")
    sets.write_model(pathlib.Path(common) / "nominal.yaml")
    placed = []  # (share of its arm that stands before it, job)
    for index, arm in enumerate(all_arms.ARMS):
        if options.arm and not any(text in arm.name or text == arm.group for text in options.arm):
            continue
        count = max(1, round(arm.sets * options.share))
        if options.first + count > all_arms.SETS_PER_ARM:
            parser.error(f"--first {options.first}: {arm.name} would share seeds with the next arm")
        placed += [((k + 0.5) / count, (index, options.first + k, options.seeds, str(options.program), options.keep, common))
                   for k in range(count)]
    if options.minutes is not None:  # so that no kind of arm stands last where the time ends early
        random.Random(0).shuffle(placed)
        placed.sort(key=lambda job: job[0])
    jobs = [job for _, job in placed]
    results, began = earlier(options.results) if options.resume else [], time.monotonic()
    asked, done = len(jobs), {(r[0], r[2]) for r in results}
    jobs = [job for job in jobs
            if (all_arms.ARMS[job[0]].name, all_arms.seed_of(all_arms.ARMS[job[0]], job[1], job[2])) not in done]
    with concurrent.futures.ProcessPoolExecutor(options.threads) as pool:
        for result in map(run_one, jobs) if options.threads == 1 else pool.map(run_one, jobs):
            results.append(result)
            name, group, seed, truth, mark, said = result
            if options.results:
                with open(options.results, "a") as out:
                    out.write(json.dumps({"arm": name, "group": group, "seed": seed, "truth": truth,
                                          "mark": dataclasses.asdict(mark), "said": said}, default=str) + "\n")
            if options.verbose:
                print(f"{'ok   ' if mark.right else 'WRONG' if mark.confidently_wrong else 'not  '} {name} seed {seed}: "
                      f"{truth['effects'] or truth['unlisted'] or truth['data_error']} -> {mark.verdict} {mark.claims} "
                      f"p {mark.probability:.3f} errors {[round(float(e), 1) for e in mark.errors]} "
                      f"floor x {mark.over_floor:.3f} {mark.seconds:.1f} s ({mark.cpu_seconds:.1f} of processors) {said}",
                      file=sys.stderr, flush=True)
            if options.minutes is not None and time.monotonic() - began > 60 * options.minutes:
                pool.shutdown(cancel_futures=True)
                break
    if not options.keep:
        shutil.rmtree(common)
    print(words_before(len(results), asked, len(done)))
    print(table(results))
    return 0


if __name__ == "__main__":
    sys.exit(main())
