#include "server/diagnosis/checks/photographs/photo_mistakes.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/text/text.h"
#include "server/diagnosis/checks/photographs/odd_pictures.h"
#include "server/diagnosis/checks/photographs/photo_channel_order.h"
#include "server/diagnosis/checks/photographs/photo_mistake_list.h"
#include "server/diagnosis/checks/photographs/photo_trial.h"
#include "server/diagnosis/checks/photographs/rules.h"

namespace touchstone::diagnosis::checks {
namespace {

struct TriedMistake {
  CandidateMistake mistake;
  double before = 1, after = 1, ratio = 1;
};

double MeanIou(const std::vector<TrialPicture>& pictures) {
  double sum = 0;
  for (const TrialPicture& picture : pictures) sum += picture.outline_iou;
  return pictures.empty() ? 0 : sum / pictures.size();
}

// Pictures of `all` that were also compared in `some`.
std::vector<TrialPicture> Same(const std::vector<TrialPicture>& all, const std::vector<TrialPicture>& some) {
  std::vector<TrialPicture> same;
  for (const TrialPicture& picture : all)
    if (std::any_of(some.begin(), some.end(), [&](const auto& s) { return s.row == picture.row; }))
      same.push_back(picture);
  return same;
}

// Both hold the same rows in the same order.
bool Convinces(const std::vector<TrialPicture>& before, const std::vector<TrialPicture>& after,
               double max_ratio, TriedMistake* tried) {
  tried->before = RobustLeft(before), tried->after = RobustLeft(after);
  tried->ratio = tried->before > 0 ? tried->after / tried->before : 1;
  int helped = 0;
  for (size_t k = 0; k < before.size(); ++k) helped += after[k].left < before[k].left;
  return tried->before >= kPhotoCheckRules.min_left && tried->after <= kPhotoCheckRules.max_left &&
         tried->ratio <= max_ratio && helped >= kPhotoCheckRules.min_agreement * before.size() &&
         MeanIou(after) > MeanIou(before);
}

class MistakeSearch {
 public:
  MistakeSearch(const DiagnosisInput& input, ThreadPool* pool)
      : input_(input), trial_(input, pool), before_(trial_.Run({}, nullptr, -1)) {}

  std::vector<PhotoMistake> Find() {
    std::vector<PhotoMistake> found;
    if (before_.size() >= kPhotoCheckRules.min_pictures) {
      for (const CandidateMistake& mistake : MistakesOfSets(*input_.images)) Try(mistake);
      for (const CandidateMistake& mistake : MistakesOfModels(*input_.model)) Try(mistake);
      TryObjects();
      found = Best();
    }
    if (found.empty())
      for (OddPictures& odd : FindOddPictures(trial_, *input_.images)) {
        TriedMistake tried{std::move(odd.mistake), odd.before, odd.after};
        found.push_back(Told(tried, true));
      }
    if (found.empty())
      if (std::optional<CandidateMistake> order = MixedChannelOrder(*input_.images)) {
        TriedMistake tried;
        tried.mistake = *std::move(order);
        found.push_back(Told(tried, true));
      }
    return found;
  }

 private:
  void Try(const CandidateMistake& mistake) {
    const std::vector<TrialPicture> after = trial_.Run(mistake.fix, mistake.model.get(), -1);
    if (after.size() < kPhotoCheckRules.min_pictures) return;
    TriedMistake tried{mistake};
    if (Convinces(Same(before_, after), after,
                  mistake.max_ratio > 0 ? mistake.max_ratio : kPhotoCheckRules.max_ratio.value(), &tried))
      convincing_.push_back(tried);
  }

  // Objects whose pictures fit the mesh of another name far better than their own.
  void TryObjects() {
    const std::vector<std::string>& names = input_.images->objects;
    std::map<std::string, std::string> right;  // by the set's name
    std::map<std::string, TriedMistake> how;
    for (size_t object = 0; object < names.size(); ++object) {
      std::vector<TrialPicture> before;
      for (const TrialPicture& picture : before_)
        if (picture.object == static_cast<int>(object)) before.push_back(picture);
      if (before.size() < kPhotoCheckRules.min_of_object || RobustLeft(before) < kPhotoCheckRules.min_left)
        continue;
      for (const auto& [other, surface] : input_.surfaces) {
        if (other == names[object]) continue;
        TriedMistake tried;
        tried.mistake.fix.rename_objects = {{names[object], other}};
        const std::vector<TrialPicture> after =
            trial_.Run(tried.mistake.fix, nullptr, static_cast<int>(object));
        if (after.size() != before.size() || !Convinces(before, after, kPhotoCheckRules.max_ratio, &tried))
          continue;
        if (right.count(names[object]) > 0 && how[names[object]].after <= tried.after) continue;
        right[names[object]] = other;
        how[names[object]] = tried;
      }
    }
    for (const auto& [name, other] : right) {
      const auto back = right.find(other);
      const bool swapped = back != right.end() && back->second == name;
      if (swapped && other < name) continue;  // told with the other
      TriedMistake tried = how[name];
      tried.mistake.kind = swapped ? ProblemKind::kObjectNames : ProblemKind::kWrongObject;
      tried.mistake.detail = absl::StrCat(name, swapped ? " <-> " : " -> ", other);
      tried.mistake.words = swapped ? absl::StrCat("the names of ", name, " and ", other, " are exchanged")
                                    : absl::StrCat("what the set calls ", name, " is ", other);
      if (swapped) tried.mistake.fix.rename_objects.emplace_back(other, name);
      convincing_.push_back(tried);
    }
  }

  // All mistakes about objects may stand together; of the others only those that fit alike.
  std::vector<PhotoMistake> Best() {
    std::stable_sort(convincing_.begin(), convincing_.end(),
                     [](const auto& a, const auto& b) { return a.ratio < b.ratio; });
    std::vector<PhotoMistake> best;
    if (convincing_.empty()) return best;
    // The whole set's explanation comes before one object's, if it leaves about as little.
    const auto whole = std::find_if(convincing_.begin(), convincing_.end(), [](const TriedMistake& tried) {
      return tried.mistake.fix.rename_objects.empty();
    });
    const bool objects = whole == convincing_.end();
    const double least = objects ? convincing_[0].after : whole->after;
    for (const TriedMistake& tried : convincing_) {
      const bool of_object = !tried.mistake.fix.rename_objects.empty();
      if (of_object != objects) continue;
      if (!objects && tried.after > kPhotoCheckRules.alike * least + 1e-4) continue;
      best.push_back(Told(tried, best.empty() || objects));
    }
    // Likelier mistakes stand first in the list; those that fit alike are told in that order.
    return best;
  }

  PhotoMistake Told(const TriedMistake& tried, bool first) const {
    PhotoMistake told;
    told.fix = tried.mistake.fix;
    told.model = tried.mistake.model;
    told.left_before = tried.before, told.left_after = tried.after;
    told.problem.kind = tried.mistake.kind;
    told.problem.detail = tried.mistake.detail;
    told.problem.words =
        absl::StrCat(first ? "It looks as if " : "These pictures cannot tell it from another mistake: ",
                     tried.mistake.words, ".");
    if (tried.mistake.kind != ProblemKind::kChannelOrder)
      absl::StrAppend(
          &told.problem.words,
          absl::StrFormat(
              tried.mistake.kind == ProblemKind::kOddPicture
                  ? " Of the other pictures %.3g %% of the variation is unexplained (median), of it "
                    "%.3g %%."
              : tried.mistake.kind == ProblemKind::kStaleRows
                  ? " Compared with that row %.3g %% of their variation is unexplained instead of %.3g %%."
                  : " Then %.3g %% of the pictures' variation is unexplained instead of %.3g %%.",
              100 * tried.after, 100 * tried.before));
    told.problem.fix =
        tried.mistake.fix.empty() ? tried.mistake.command : FixCommand(tried.mistake.fix, *input_.images);
    return told;
  }

  const DiagnosisInput& input_;
  const PhotoTrial trial_;
  const std::vector<TrialPicture> before_;
  std::vector<TriedMistake> convincing_;
};

}  // namespace

std::vector<PhotoMistake> FindPhotoMistakes(const DiagnosisInput& input, const DiagnosisContext& context) {
  return MistakeSearch(input, context.pool).Find();
}

std::string FixCommand(const session::ImageSetFix& fix, const session::ImageSet& set) {
  const bool plain =
      !set.origin.empty() && set.origin.find_first_of(" '\"$\\`;&|<>()*?!") == std::string::npos;
  return absl::StrCat("touchstone session fix ", plain ? set.origin : "FOLDER", " ", session::FixOptions(fix),
                      " -o fixed");
}

}  // namespace touchstone::diagnosis::checks
