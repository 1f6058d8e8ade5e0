#include "server/diagnosis/images/rows/photo_rest_kinds.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/diagnosis/images/rows/rest_kind_sums.h"
#include "server/diagnosis/images/rows/rules.h"
#include "server/diagnosis/images/rows/stuck_pixels.h"
#include "server/diagnosis/images/rules.h"

namespace touchstone::diagnosis::images {
namespace {

class RestKinds {
 public:
  RestKinds(const Photographs& photographs, const std::vector<image::Photo>& expected, ThreadPool* pool)
      : p_(photographs), expected_(expected), sums_(photographs.size()) {
    ParallelFor(pool, p_.size(), 1, [&](int begin, int end) {
      for (int k = begin; k < end; ++k) Sum(k);
    });
    for (int k = 0; k < p_.size(); ++k) {
      excess_ += sums_[k].Excess();
      fold_.push_back(p_.pose[k] % kKindFolds);
    }
  }

  std::vector<KindOfRest> Find() const {
    std::vector<KindOfRest> kinds;
    if (!(excess_ > 0)) return kinds;
    for (const KindOfRest& kind : {Few(), Stuck(), Light(), Place(), InPicture(), OnObjects(), Contours()})
      if (kind.share >= kPhotoRowRules.min_kind_share) kinds.push_back(kind);
    std::stable_sort(kinds.begin(), kinds.end(),
                     [](const auto& a, const auto& b) { return a.share > b.share; });
    if (kinds.empty() || kinds[0].share < kPhotoRowRules.min_cause_share)
      if (KindOfRest one = OneObject(); one.share > 0) kinds.insert(kinds.begin(), std::move(one));
    return kinds;
  }

 private:
  void Sum(int k) {
    PictureSums& sums = sums_[k];
    const image::Photo& photo = expected_[k];
    const std::vector<float>& grey = photo.grey;
    const int width = p_.width(), height = p_.height();
    const geometry::Bounds& bounds = p_.surfaces[p_.object[k]]->bounds();
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const size_t at = static_cast<size_t>(y) * width + x;
        const double expected = grey[at], residual = p_.measured_grey[k][at] - expected;
        sums.squares += residual * residual;
        sums.noise += p_.record->Variance(expected);
        const auto near = [&](int column, int row) -> double {
          return grey[static_cast<size_t>(std::clamp(row, 0, height - 1)) * width +
                      std::clamp(column, 0, width - 1)];
        };
        const int half = (x / kPhotoRowRules.block_px + y / kPhotoRowRules.block_px) % 2;
        sums.light[half].Add(Eigen::Matrix<double, 1, 1>(expected), residual);
        const double right = 0.5 * (near(x - 1, y) - near(x + 1, y)),
                     down = 0.5 * (near(x, y - 1) - near(x, y + 1)), v = 2 * (y + 0.5) / height - 1;
        if (right != 0 || down != 0)
          sums.place[half].Add(Eigen::Vector4d(right, down, right * v, down * v), residual);
        const double bend = near(x - 1, y) + near(x + 1, y) + near(x, y - 1) + near(x, y + 1) - 4 * expected;
        if (bend != 0) sums.contours.Add(Eigen::Matrix<double, 1, 1>(bend), residual);
        sums.in_picture.Add(
            static_cast<size_t>(y * kPhotoRowRules.map_cells / height * kPhotoRowRules.map_cells +
                                x * kPhotoRowRules.map_cells / width),
            expected, residual);
        if (photo.mask[at] == 0) continue;
        size_t place = 0;
        for (int axis = 0; axis < 3; ++axis) {
          const double extent = std::max(bounds.max_m[axis] - bounds.min_m[axis], 1e-9);
          const double share = (photo.point_m[at][axis] - bounds.min_m[axis]) / extent;
          place =
              place * kImageRules.object_cells +
              std::clamp(static_cast<int>(share * kImageRules.object_cells), 0, kImageRules.object_cells - 1);
        }
        sums.on_object.Add(place, expected, residual);
      }
  }

  double Share(double taken) const { return std::clamp(taken / excess_, 0.0, 1.0); }

  // A few pictures that hold most of what is left.
  KindOfRest Few() const {
    std::vector<int> order(p_.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return sums_[a].Excess() > sums_[b].Excess(); });
    const size_t most = std::max<size_t>(1, static_cast<size_t>(kPhotoRowRules.max_few_share * p_.size()));
    double held = 0;
    std::vector<uint64_t> images;
    for (size_t n = 0; n < std::min(most, order.size()) && held < kPhotoRowRules.min_few_share * excess_;
         ++n) {
      held += sums_[order[n]].Excess();
      images.push_back(p_.set->photographs[p_.row[order[n]]].image);
    }
    std::sort(images.begin(), images.end());
    const double share = Share(held);
    const bool one = images.size() == 1;
    return {RestKind::kFewPictures, share < kPhotoRowRules.min_few_share ? 0 : share,
            absl::StrFormat("%.0f %% of it lies in %s %s of %d.", 100 * share, one ? "image" : "images",
                            absl::StrJoin(images, ", "), p_.size()),
            absl::StrFormat("Look at %s for something that covers the object, or for another object or pose "
                            "than images.csv says.",
                            one ? "it" : "them")};
  }

  KindOfRest OneObject() const {
    std::vector<double> held(p_.objects.size(), 0.0), pictures(p_.objects.size(), 0.0);
    for (int k = 0; k < p_.size(); ++k) held[p_.object[k]] += sums_[k].Excess(), ++pictures[p_.object[k]];
    const size_t most = std::max_element(held.begin(), held.end()) - held.begin();
    const double share = Share(held[most]);
    const bool stands_out = share >= kPhotoRowRules.min_object_share &&
                            share >= kPhotoRowRules.min_object_ratio * pictures[most] / p_.size();
    return {RestKind::kOneObject, stands_out ? share : 0,
            absl::StrFormat("%.0f %% of it lies in the pictures of %s (%.0f of %d).", 100 * share,
                            p_.objects[most], pictures[most], p_.size()),
            ""};
  }

  KindOfRest Stuck() const {
    const StuckPixels stuck = FindStuckPixels(p_, expected_);
    const double share = Share(stuck.excess);
    return {RestKind::kStuckPixels, share,
            absl::StrFormat("%s the same grey level in every picture, whatever lies there, and %.0f %% of it "
                            "is theirs: %s.",
                            stuck.places.size() == 1 ? "One pixel shows"
                                                     : absl::StrCat(stuck.places.size(), " pixels show"),
                            100 * share, PlacesInWords(stuck)),
            "Hot or dead pixels of the camera: let it correct them, or put the mean of their neighbours in "
            "their place."};
  }

  KindOfRest Light() const {
    double taken = 0, squares = 0;
    for (const PictureSums& sums : sums_) {
      for (int half = 0; half < 2; ++half) taken += sums.light[half].Taken(sums.light[1 - half].Solve());
      KindSums<1> both = sums.light[0];
      both.Add(sums.light[1]);
      squares += std::pow(both.Solve()[0], 2);
    }
    const double share = Share(taken);
    return {RestKind::kLightOfPicture, share,
            absl::StrFormat("It differs from picture to picture: a brightness of each picture's own (%.2g %% "
                            "root mean square) takes %.0f %% of it.",
                            100 * std::sqrt(squares / p_.size()), 100 * share),
            "The lamp flickers, or the camera chooses its exposure. Fix exposure and gain by hand, and "
            "photograph a grey card twice."};
  }

  KindOfRest Place() const {
    double taken = 0, even = 0, growing = 0;
    for (const PictureSums& sums : sums_) {
      for (int half = 0; half < 2; ++half) taken += sums.place[half].Taken(sums.place[1 - half].Solve());
      KindSums<kPlaceColumns> both = sums.place[0];
      both.Add(sums.place[1]);
      const Eigen::Vector4d moved = both.Solve();
      even += moved.head<2>().squaredNorm(), growing += moved.tail<2>().squaredNorm();
    }
    const double share = Share(taken), even_px = std::sqrt(even / p_.size()),
                 growing_px = 2 * std::sqrt(growing / p_.size());
    const bool shutter = growing_px > kPhotoRowRules.shutter_share * even_px;
    return {
        RestKind::kPlaceOfPicture, share,
        absl::StrFormat(
            "It differs from picture to picture: a displacement of each picture's own (%.2g px%s) "
            "takes %.0f %% of it.",
            even_px,
            shutter ? absl::StrFormat(", and %.2g px from the top row to the bottom one", growing_px) : "",
            100 * share),
        shutter
            ? "The camera moves while its rows are read (rolling shutter). Let the arm stand still before "
              "each picture."
            : "Poses are off by an amount of their own, or the camera moves. Photograph one pose several "
              "times, coming from other sides."};
  }

  KindOfRest InPicture() const {
    std::vector<const Cells*> pictures;
    for (const PictureSums& sums : sums_) pictures.push_back(&sums.in_picture);
    const double share = Share(TakenByCells(pictures, fold_));
    return {RestKind::kInPicture, share,
            absl::StrFormat("Grey levels differ at the same places of every picture (%.0f %% of it).",
                            100 * share),
            "That is dirt on the lens, a reflection, or stray light. Photograph a plain white sheet."};
  }

  KindOfRest OnObjects() const {
    double taken = 0;
    for (int object = 0; object < static_cast<int>(p_.objects.size()); ++object) {
      std::vector<const Cells*> pictures;
      std::vector<int> fold;
      for (int k = 0; k < p_.size(); ++k) {
        if (p_.object[k] != object) continue;
        pictures.push_back(&sums_[k].on_object);
        fold.push_back(fold_[k]);
      }
      taken += TakenByCells(pictures, fold);
    }
    const double share = Share(taken);
    return {RestKind::kOnObjects, share,
            absl::StrFormat("The light of the objects' surfaces differs by smooth patches that stay at their "
                            "places (%.0f %% of it).",
                            100 * share),
            "That is paint, dirt, or a shape that departs from its mesh."};
  }

  KindOfRest Contours() const {
    KindSums<1> all;
    for (const PictureSums& sums : sums_) all.Add(sums.contours);
    double taken = 0;
    for (int f = 0; f < kKindFolds; ++f) {
      KindSums<1> others = all, own;
      for (int k = 0; k < p_.size(); ++k)
        if (fold_[k] == f) own.Add(sums_[k].contours);
      others.Remove(own);
      taken += own.Taken(others.Solve());
    }
    const bool sharper = all.Solve()[0] < 0;
    const double share = Share(taken);
    const std::string of_it = absl::StrFormat(" (%.0f %% of it).", 100 * share);
    return {RestKind::kContours, share,
            absl::StrCat(sharper ? "Contours are sharper than light can make them, with a bright and a dark "
                                   "line along them"
                                 : "Contours are softer than expected in every picture",
                         of_it),
            sharper ? "The camera sharpens its pictures. Switch sharpening off."
                    : "That is focus, motion, or a picture that was made smaller or compressed. Photograph a "
                      "sharp edge."};
  }

  const Photographs& p_;
  const std::vector<image::Photo>& expected_;
  std::vector<PictureSums> sums_;
  std::vector<int> fold_;
  double excess_ = 0;  // squares
};

}  // namespace

std::vector<KindOfRest> KindsOfRest(const Photographs& photographs, const std::vector<image::Photo>& expected,
                                    ThreadPool* pool) {
  return RestKinds(photographs, expected, pool).Find();
}

std::string InWords(const KindOfRest& kind) {
  return kind.cause.empty() || kind.share < kPhotoRowRules.min_cause_share
             ? kind.words
             : absl::StrCat(kind.words, " ", kind.cause);
}

double ShareOf(RestKind kind, const std::vector<KindOfRest>& kinds) {
  for (const KindOfRest& one : kinds)
    if (one.kind == kind) return one.share;
  return 0;
}

}  // namespace touchstone::diagnosis::images
