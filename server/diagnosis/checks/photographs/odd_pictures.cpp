#include "server/diagnosis/checks/photographs/odd_pictures.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "server/diagnosis/checks/photographs/rules.h"

namespace touchstone::diagnosis::checks {
namespace {

using Mirror = session::ImageSetFix::Mirror;

std::string ImagesInWords(const std::vector<uint64_t>& images) {
  return absl::StrCat(images.size() == 1 ? "image " : "images ", absl::StrJoin(images, ", "));
}

class OddSearch {
 public:
  OddSearch(const PhotoTrial& trial, const session::ImageSet& set) : trial_(trial), set_(set) {}

  std::vector<OddPictures> Find() {
    std::vector<int> all(trial_.size());
    std::iota(all.begin(), all.end(), 0);
    const std::vector<TrialPicture> pictures = trial_.RunOn(all, {}, nullptr);
    if (pictures.size() < kPhotoCheckRules.min_all) return {};
    std::vector<double> left;
    for (const TrialPicture& picture : pictures) left.push_back(picture.left);
    std::nth_element(left.begin(), left.begin() + static_cast<long>(left.size() / 2), left.end());
    median_ = left[left.size() / 2];
    if (median_ > kPhotoCheckRules.max_median) return {};
    for (const TrialPicture& picture : pictures)
      if (picture.left >
          std::max(kPhotoCheckRules.min_odd_left.value(), kPhotoCheckRules.min_odd_ratio * median_))
        odd_.push_back(picture);
    if (odd_.empty() || odd_.size() > kPhotoCheckRules.max_stale_share * pictures.size()) return {};
    TryStale();
    const std::vector<TrialPicture> left_over = NotFixed();
    if (left_over.size() >
        std::max<size_t>(2, static_cast<size_t>(kPhotoCheckRules.max_odd_share * pictures.size())))
      return std::move(found_);
    TryExchanges();
    TryAlone();
    const std::vector<TrialPicture> unknown = NotFixed();
    if (!unknown.empty()) AddUnknown(unknown);
    return std::move(found_);
  }

 private:
  uint64_t ImageOf(const TrialPicture& picture) const { return set_.photographs[picture.row].image; }

  bool IsFixed(double before, double after) const {
    return after < std::max(kPhotoCheckRules.like_others * median_, kPhotoCheckRules.fixed_ratio * before) &&
           after < before;
  }

  std::vector<TrialPicture> NotFixed() const {
    std::vector<TrialPicture> left;
    for (const TrialPicture& picture : odd_)
      if (fixed_.count(picture.row) == 0) left.push_back(picture);
    return left;
  }

  // Pictures of the view of a row before, whose own picture is as it should be: the camera gave an old one.
  void TryStale() {
    const auto is_odd = [&](int row) {
      return std::any_of(odd_.begin(), odd_.end(), [&](const auto& odd) { return odd.row == row; });
    };
    std::vector<TrialPicture> stale;
    OddPictures found{{}, 0, 0};
    for (const TrialPicture& picture : odd_) {
      int shown = picture.row - 1;
      while (shown >= 0 && is_odd(shown) && picture.row - shown < kPhotoCheckRules.max_stale_rows) --shown;
      if (shown < 0 || is_odd(shown)) continue;
      session::ImageSetFix at_shown;  // this picture in that row
      at_shown.exchange = {ImageOf(picture), set_.photographs[shown].image};
      const std::vector<TrialPicture> after = trial_.RunOn({shown}, at_shown, nullptr);
      if (after.size() != 1 || after[0].left > kPhotoCheckRules.fixed_ratio * picture.left) continue;
      stale.push_back(picture);
      fixed_.insert(picture.row);
      found.after += after[0].left;
    }
    if (stale.empty()) return;
    const double count = static_cast<double>(stale.size());
    found.after /= count;
    for (const TrialPicture& picture : stale) {
      found.mistake.fix.drop.push_back(ImageOf(picture));
      found.before += picture.left / count;
    }
    found.mistake.kind = ProblemKind::kStaleRows;
    found.mistake.detail = ImagesInWords(found.mistake.fix.drop);
    found.mistake.words = absl::StrCat(
        found.mistake.detail, stale.size() == 1 ? " shows" : " show",
        " the view of the row before: the camera gave an old picture (empty its buffer before each picture)");
    found_.push_back(std::move(found));
  }

  // The best exchange first, each picture once.
  void TryExchanges() {
    struct Pair {
      size_t one, other;
      double after;
    };
    std::vector<Pair> pairs;
    const std::vector<TrialPicture> odd = NotFixed();
    for (size_t a = 0; a < odd.size(); ++a)
      for (size_t b = a + 1; b < odd.size(); ++b) {
        session::ImageSetFix fix;
        fix.exchange = {ImageOf(odd[a]), ImageOf(odd[b])};
        const std::vector<TrialPicture> after = trial_.RunOn({odd[a].row, odd[b].row}, fix, nullptr);
        if (after.size() == 2 && IsFixed(odd[a].left, after[0].left) && IsFixed(odd[b].left, after[1].left))
          pairs.push_back({a, b, 0.5 * (after[0].left + after[1].left)});
      }
    std::sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) { return a.after < b.after; });
    for (const Pair& pair : pairs) {
      const TrialPicture &one = odd[pair.one], &other = odd[pair.other];
      if (fixed_.count(one.row) > 0 || fixed_.count(other.row) > 0) continue;
      fixed_.insert({one.row, other.row});
      OddPictures exchanged{{}, 0.5 * (one.left + other.left), pair.after};
      exchanged.mistake.kind = ProblemKind::kExchanged;
      exchanged.mistake.detail = absl::StrCat("image ", ImageOf(one), " <-> image ", ImageOf(other));
      exchanged.mistake.words =
          absl::StrCat("images ", ImageOf(one), " and ", ImageOf(other), " stand in each other's row");
      exchanged.mistake.fix.exchange = {ImageOf(one), ImageOf(other)};
      found_.push_back(std::move(exchanged));
    }
  }

  // Each picture by itself: turned, mirrored, its camera the other way round.
  void TryAlone() {
    std::vector<CandidateMistake> kinds;
    const auto add = [&](ProblemKind kind, const char* words) -> session::ImageSetFix& {
      kinds.push_back({kind, "", words, {}, nullptr, "", 0});
      return kinds.back().fix;
    };
    add(ProblemKind::kUpAxis, "has its camera's up reversed").reverse_up = true;
    for (const int turn_deg : {180, 90, 270}) {
      if (turn_deg != 180 && set_.camera.width_px != set_.camera.height_px) continue;
      add(ProblemKind::kRotated, "is turned").rotate_deg = turn_deg;
    }
    add(ProblemKind::kMirrored, "is mirrored").mirror = Mirror::kLeftRight;
    add(ProblemKind::kMirrored, "is mirrored").mirror = Mirror::kUpDown;
    for (const TrialPicture& picture : odd_) {
      if (fixed_.count(picture.row) > 0) continue;
      OddPictures best{{}, picture.left, picture.left};
      for (const CandidateMistake& kind : kinds) {
        CandidateMistake mistake = kind;
        mistake.fix.images = {{ImageOf(picture), ImageOf(picture)}};
        const std::vector<TrialPicture> after = trial_.RunOn({picture.row}, mistake.fix, nullptr);
        if (after.size() != 1 || !IsFixed(picture.left, after[0].left) || after[0].left >= best.after)
          continue;
        mistake.detail = absl::StrCat("image ", ImageOf(picture));
        mistake.words = absl::StrCat("image ", ImageOf(picture), " ", kind.words);
        best.after = after[0].left;
        best.mistake = std::move(mistake);
      }
      if (best.mistake.words.empty()) continue;
      fixed_.insert(picture.row);
      found_.push_back(std::move(best));
    }
  }

  void AddUnknown(const std::vector<TrialPicture>& unknown) {
    OddPictures odd{{}, 0, median_};
    for (const TrialPicture& picture : unknown) {
      odd.mistake.fix.drop.push_back(ImageOf(picture));
      odd.before += picture.left / static_cast<double>(unknown.size());
    }
    const std::string images = ImagesInWords(odd.mistake.fix.drop);
    odd.mistake.kind = ProblemKind::kOddPicture;
    odd.mistake.detail = images;
    odd.mistake.words = absl::StrCat(
        images, unknown.size() == 1 ? " shows" : " show",
        " something else than images.csv says, or something lies before the camera (a hand, a cable)");
    found_.push_back(std::move(odd));
  }

  const PhotoTrial& trial_;
  const session::ImageSet& set_;
  double median_ = 0;
  std::vector<TrialPicture> odd_;
  std::set<int> fixed_;  // rows
  std::vector<OddPictures> found_;
};

}  // namespace

std::vector<OddPictures> FindOddPictures(const PhotoTrial& trial, const session::ImageSet& set) {
  return OddSearch(trial, set).Find();
}

}  // namespace touchstone::diagnosis::checks
