// touchstone-hidden-effects: how good is the diagnosis? Prints the table of tests/hidden_effects/RESULTS.md.
#include <CLI/CLI.hpp>

#include <cmath>
#include <cstdio>
#include <filesystem>

#include "tests/hidden_effects/score/figures_table.h"
#include "tests/hidden_effects/score/next_touches.h"
#include "tests/hidden_effects/score/trial.h"

int main(int argc, char** argv) {
  using namespace touchstone::hidden;
  TrialOptions options;
  std::string seeds = "tuning", meshes = TOUCHSTONE_SHARED_MESHES;
  bool verbose = false, no_baselines = false;
  bool only_listed = false, only_outside = false;
  int races = -1;
  CLI::App app{"Hides effects in measurement sets, diagnoses them, and prints how often that was right."};
  app.add_option("--seeds", seeds, "tuning or held-out")->check(CLI::IsMember({"tuning", "held-out"}));
  app.add_option("--share", options.share, "of the number of sets of every arm")->check(CLI::PositiveNumber);
  app.add_option("--arm", options.arms, "only this arm (may be repeated)");
  app.add_option("--limit", options.limit_s, "seconds of CPU time after which a diagnosis is cancelled")
      ->check(CLI::PositiveNumber);
  app.add_flag("--listed", only_listed, "only arms that the catalogue lists");
  app.add_flag("--outside", only_outside, "only the others");
  app.add_option("--threads", options.threads, "sets at once")->check(CLI::Range(1, 64))->take_last();
  app.add_option("--meshes", meshes, "folder with lat00.off ...; missing ones are made");
  app.add_option("--dump", options.dump_folder, "write sets that were judged wrong there");
  app.add_flag("--verbose", verbose, "a line per set: truth, verdict, steps, values");
  app.add_flag("--no-baselines", no_baselines, "only the diagnosis");
  app.add_option("--races", races,
                 "designed against random next touches; default: 20 by share, none with --arm");
  CLI11_PARSE(app, argc, argv);
  for (const std::string& arm : options.arms) {
    if (FindArm(arm) != nullptr) continue;
    fprintf(stderr, "no arm is called '%s'; there are:\n", arm.c_str());
    for (const Arm& known : Arms()) fprintf(stderr, "  %s\n", known.name.c_str());
    return 2;
  }
  for (const Arm& arm : Arms())
    if ((only_listed && arm.listed()) || (only_outside && !arm.listed())) options.arms.push_back(arm.name);
  options.seeds = seeds == "held-out" ? Seeds::kHeldOut : Seeds::kTuning;
  options.baselines = !no_baselines;
  if (!options.dump_folder.empty()) std::filesystem::create_directories(options.dump_folder);

  const TestObjects objects = LoadTestObjects(meshes);
  const TrialResult result = RunTrial(options, objects, [&](const Outcome& outcome, int done, int of) {
    if (verbose) {
      printf("%s %s %llu (%.1f s): hidden %s => %s%s\n", AllRight(outcome) ? "ok   " : "WRONG",
             outcome.arm->name.c_str(), static_cast<unsigned long long>(outcome.seed), outcome.seconds,
             TruthInWords(outcome.set.truth).c_str(), ReportInWords(outcome.report).c_str(),
             outcome.error.c_str());
      if (ClaimsAFall(outcome.report))
        printf("        unseen touches leave %.0f us by the report, fresh ones %.0f us\n",
               ClaimedErrorUs(outcome.report), outcome.tried.fresh_us);
      for (const std::vector<Mark>* marks : {&outcome.marks, &outcome.figures})
        for (const Mark& mark : *marks)
          printf("        %s: %s\n", mark.measure.c_str(), mark.yes ? "yes" : "no");
      fflush(stdout);
    } else if (done % 20 == 0 || done == of) {
      fprintf(stderr, "%d of %d sets\n", done, of);
    }
  });
  printf("%s\n%s", Table(result.results).c_str(), FiguresTable(result).c_str());
  const auto& seconds = result.seconds;
  if (!seconds.empty())
    printf(
        "\n%d sets, %d without a report. One diagnosis takes %.2f s of one core (median), %.2f s "
        "(slowest).\n",
        result.sets, result.errors, seconds[seconds.size() / 2], seconds.back());
  if (races < 0)
    races = options.arms.empty() ? std::max(1, static_cast<int>(std::lround(20 * options.share))) : 0;
  const Races raced = RunRaces(objects, options.seeds, races, options.threads, [&](const Race& race) {
    if (verbose)
      printf("race: hidden %s => designed %d (%d proposed)%s, random %d%s %s\n",
             TruthInWords(race.truth).c_str(), race.designed, race.proposed,
             race.designed_arrived ? "" : " (gave up)", race.random, race.random_arrived ? "" : " (gave up)",
             race.error.c_str());
  });
  if (races > 0) printf("\n%s", RacesInWords(raced).c_str());
  return result.errors == 0 ? 0 : 1;
}
