#include "server/diagnosis/distributions/pose_free.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/readable_time.h"
#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/distributions/compatible_effects.h"
#include "server/diagnosis/distributions/pose_free_report.h"
#include "server/effects/all_effects.h"

namespace touchstone {
namespace {

constexpr double kSuspicious = 0.1;
constexpr double kSmallP = 0.005;  // below it the model is not compatible
const SupposedPoses kWidePoses{32 * kRadiansPerDegree, 0.62};
constexpr double kBeforeFit = 0.1, kBeforeRank = 0.2, kBeforeEffects = 0.5,
                 kBeforeRenewal = 0.8145;  // of the work

// The noise that the rounds show is known for certain, whatever else is wrong. Returns what to say about it.
std::string FillNoiseChange(const UnposedCase& the_case, double p, v1::Report* report) {
  const double error_us = the_case.scatter_s / std::sqrt(2 * std::max(1.0, the_case.degrees)) * 1e6;
  const auto fill_noise = [&](v1::ParameterValue* value) {
    value->set_name("sigma_us");
    value->set_unit("us");
    value->set_value(the_case.scatter_s * 1e6);
    value->set_std_error(error_us);
    value->set_lower(the_case.scatter_s * 1e6 - 1.96 * error_us);
    value->set_upper(the_case.scatter_s * 1e6 + 1.96 * error_us);
  };
  std::string noise_words;
  if (the_case.noise_is_new) {
    v1::Step* step = report->add_steps();
    step->set_effect("gaussian_noise");
    step->set_probability(1);
    step->set_scope("rig");
    step->set_lack_of_fit_p(p);
    const auto effect = Catalogue().Find("gaussian_noise");
    step->set_meaning(effect->meaning);
    step->set_check_on_rig(effect->check_on_rig);
    step->set_remedy(effect->remedy);
    fill_noise(step->add_parameters());
    noise_words = absl::StrCat("Rounds of the same poses scatter by ", TimeInWords(the_case.scatter_s),
                               " a finger; the model has no noise. ");
  } else if (the_case.noise_changed) {
    v1::Refit* refit = report->add_refitted();
    refit->set_effect("gaussian_noise");
    fill_noise(refit->add_parameters());
    noise_words = absl::StrCat("Rounds of the same poses scatter by ", TimeInWords(the_case.scatter_s),
                               " a finger, not as the model says. ");
  }
  if (the_case.noise_changed) {
    report->set_improved_model_yaml(FormatModel(*the_case.model));
    report->set_improved_model_hash(the_case.model->Hash());
  }
  return noise_words;
}

std::string DifferenceInWords(const std::vector<CompatibleEffect>& compatible) {
  std::vector<std::string> words;
  for (const CompatibleEffect& effect : compatible)
    words.push_back(absl::StrCat(effect.effect, " (", effect.values, ")"));
  if (words.empty())
    return "No single effect of the catalogue would make them alike: there may be several, or another "
           "protocol or speed. ";
  if (words.size() == 1)
    return absl::StrCat("The only compatible effect of the catalogue is ", words[0],
                        "; that is no proof: several at once, another protocol or speed may do the same. ");
  return absl::StrCat("Compatible effects are ", absl::StrJoin(words, ", "),
                      "; which of them it is, if it is one, times alone cannot tell. ");
}

// What would make the sets alike.
absl::StatusOr<std::vector<CompatibleEffect>> CompatibleEffects(const UnposedCase& the_case,
                                                                const UnposedRank& rank) {
  const auto misfit_under = [&](UnposedNull null) -> MisfitOfModel {
    return [&the_case, null = std::move(null)](const std::shared_ptr<const Model>& model,
                                               const SupposedPoses& poses,
                                               ReferenceSize size) -> absl::StatusOr<UnposedMisfit> {
      TOUCHSTONE_ASSIGN_OR_RETURN(const UnposedSamples reference, the_case.MakeReference(model, poses, size));
      const std::vector<double> distances = UnposedDistances(the_case.measured, reference);
      return UnposedMisfit{null.Together(distances), null.P(distances)};
    };
  };
  const auto renew = [&](const std::shared_ptr<const Model>& model,
                         const SupposedPoses& poses) -> absl::StatusOr<MisfitOfModel> {
    TOUCHSTONE_ASSIGN_OR_RETURN(const UnposedRank own, UnposedRank::Make(the_case, model, poses, true,
                                                                         kBeforeRenewal, kBeforeRenewal));
    return misfit_under(own.Null(the_case.objects.size()));
  };
  // Poses that were fitted to a model that lacks an effect may be far from the right ones.
  const std::vector<SupposedPoses> poses = {SupposedPoses(), kWidePoses, rank.poses()};
  return FindCompatibleEffects(
      *the_case.model, the_case.degrees >= UnposedCase::kFewDegrees, the_case.input.also, poses,
      misfit_under(rank.Null(the_case.objects.size())), renew, the_case.context.pool, [&](double done) {
        return the_case.Progress("trying effects", kBeforeEffects + (1 - kBeforeEffects) * done);
      });
}

absl::Status Judge(const UnposedCase& the_case, const UnposedRank& rank, v1::Report* report) {
  const std::string noise_words = FillNoiseChange(the_case, rank.p(), report);
  if (rank.p() > kSmallP) {
    report->set_verdict(the_case.noise_is_new ? v1::Report::MISSING_EFFECTS : v1::Report::ADEQUATE);
    report->set_summary(absl::StrCat(noise_words,
                                     "As distributions, the measured times and those of the model ",
                                     the_case.noise_changed ? "with that noise " : "",
                                     "do not differ (p = ", absl::StrFormat("%.2g", rank.p()),
                                     "). That says little: without poses only large errors show."));
    return absl::OkStatus();
  }
  report->set_verdict(v1::Report::UNEXPLAINED);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<CompatibleEffect> compatible,
                              CompatibleEffects(the_case, rank));
  for (const CompatibleEffect& effect : compatible)
    report->mutable_distributions()->add_compatible_effects(effect.effect);
  report->set_summary(absl::StrCat(
      noise_words,
      "As distributions, the measured times differ from the model's (p = ", absl::StrFormat("%.2g", rank.p()),
      "). ", DifferenceInWords(compatible), "To know more, write down the poses of the touches."));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<v1::Report> CompareUnposed(const DiagnosisInput& input, const DiagnosisContext& context,
                                          bool diagnose) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto made, UnposedCase::Create(input, context));
  const UnposedCase& the_case = *made;
  v1::Report report;
  FillUnposedData(the_case, &report);
  if (report.touches() == 0)
    return absl::InvalidArgumentError(
        absl::StrCat(the_case.set.origin,
                     ": no touch has a time of every finger; without poses there is nothing to compare"));

  TOUCHSTONE_ASSIGN_OR_RETURN(
      UnposedRank rank, UnposedRank::Make(the_case, the_case.model, SupposedPoses(), true, 0, kBeforeFit));
  const bool fitted = rank.p() <= kSuspicious;
  if (fitted) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const SupposedPoses poses, FitPoses(the_case, rank, kBeforeFit, kBeforeRank));
    TOUCHSTONE_ASSIGN_OR_RETURN(
        rank, UnposedRank::Make(the_case, the_case.model, poses, false, kBeforeRank, kBeforeEffects));
  }
  FillUnposedComparison(the_case, rank, fitted, &report);
  if (diagnose) {
    TOUCHSTONE_RETURN_IF_ERROR(Judge(the_case, rank, &report));
    report.mutable_final()->set_lack_of_fit_p(rank.p());
  } else {
    report.set_summary(absl::StrCat("As distributions, the measured times ",
                                    rank.p() > kSmallP ? "do not differ" : "differ",
                                    " from the model's (p = ", absl::StrFormat("%.2g", rank.p()), ")."));
  }
  the_case.Progress("done", 1);
  return report;
}

}  // namespace touchstone
