#include "server/diagnosis/checks/photographs/photo_trial.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/diagnosis/checks/photographs/rules.h"
#include "server/diagnosis/checks/rules.h"
#include "server/image/photograph/simulate_photo.h"

namespace touchstone::diagnosis::checks {
namespace {

// Means of squares of shrink x shrink pixels; what does not fill one is cut off.
session::PhotographRow Small(const session::PhotographRow& row, int width, int height, int shrink) {
  session::PhotographRow small = row;
  const int w = width / shrink, h = height / shrink, channels = row.channels;
  small.pixels.assign(static_cast<size_t>(w) * h * channels, 0);
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x)
      for (int c = 0; c < channels; ++c) {
        int sum = 0;
        for (int j = 0; j < shrink; ++j)
          for (int i = 0; i < shrink; ++i)
            sum += row.pixels[(static_cast<size_t>(y * shrink + j) * width + x * shrink + i) * channels + c];
        small.pixels[(static_cast<size_t>(y) * w + x) * channels + c] =
            static_cast<uint8_t>((sum + shrink * shrink / 2) / (shrink * shrink));
      }
  return small;
}

// Pictures spread over the set, as many of each object as there are.
std::vector<int> Chosen(const session::ImageSet& set) {
  std::vector<std::vector<int>> of_object(set.objects.size());
  for (size_t row = 0; row < set.size(); ++row)
    of_object[set.photographs[row].object].push_back(static_cast<int>(row));
  const int each = std::max<int>(
      4, kPhotoCheckRules.max_compared / std::max<int>(1, static_cast<int>(set.objects.size())));
  std::vector<int> rows;
  for (const std::vector<int>& all : of_object) {
    const int count = std::min<int>(each, static_cast<int>(all.size()));
    for (int k = 0; k < count; ++k) rows.push_back(all[(2 * k + 1) * all.size() / (2 * count)]);
  }
  std::sort(rows.begin(), rows.end());
  return rows;
}

// The grey level that parts a picture best in two (Otsu 1979).
double Threshold(const std::vector<float>& grey) {
  std::array<double, 256> count{};
  for (const float g : grey) ++count[std::clamp(static_cast<int>(g + 0.5f), 0, 255)];
  double all = 0, sum = 0;
  for (int g = 0; g < 256; ++g) all += count[g], sum += g * count[g];
  double below = 0, below_sum = 0, best = -1;
  int threshold = 0;
  for (int g = 0; g < 255; ++g) {
    below += count[g], below_sum += g * count[g];
    if (below == 0 || below == all) continue;
    const double apart = below_sum / below - (sum - below_sum) / (all - below);
    const double between = below * (all - below) * apart * apart;
    if (between > best) best = between, threshold = g;
  }
  return threshold + 0.5;
}

double Left(const std::vector<float>& measured, const std::vector<float>& expected) {
  const double n = static_cast<double>(measured.size());
  double m = 0, e = 0, mm = 0, ee = 0, me = 0;
  for (size_t i = 0; i < measured.size(); ++i) {
    m += measured[i], e += expected[i];
    mm += measured[i] * measured[i], ee += expected[i] * expected[i], me += measured[i] * expected[i];
  }
  const double vm = mm / n - m * m / n / n, ve = ee / n - e * e / n / n, cov = me / n - m * e / n / n;
  if (!(vm > 1e-9) || !(ve > 1e-9) || cov <= 0) return 1;
  return std::clamp(1 - cov * cov / (vm * ve), 0.0, 1.0);
}

// The threshold cuts away what is dark of an object, in the expected picture as in the measured one.
double OutlineIou(const std::vector<float>& measured, const std::vector<float>& expected) {
  const double tm = Threshold(measured), te = Threshold(expected);
  int both = 0, either = 0;
  for (size_t i = 0; i < measured.size(); ++i) {
    const bool a = measured[i] > tm, b = expected[i] > te;
    both += a && b, either += a || b;
  }
  return either == 0 ? 0 : static_cast<double>(both) / either;
}

image::PhotoRequest RequestOf(const session::ImageSet& set, const session::PhotographRow& row,
                              std::shared_ptr<const geometry::Surface> surface) {
  image::PhotoRequest request;
  request.surface = std::move(surface);
  request.object = set.objects[row.object];
  request.camera.eye_m = row.commanded.eye_m;
  request.camera.at_m = row.commanded.at_m;
  request.camera.up = row.commanded.up;
  const session::CameraIntrinsics& camera = set.camera;
  request.lens = {camera.width_px,
                  camera.height_px,
                  camera.fx_px,
                  camera.fy_px,
                  camera.cx_px,
                  camera.cy_px,
                  {camera.k1, camera.k2, camera.p1, camera.p2, camera.k3}};
  request.session_time_s = row.session_time_s;
  return request;
}

}  // namespace

model::Model ForSmallPictures(const model::Model& model, int shrink) {
  model::Model small = model;
  for (model::EffectInstance& instance : small.effects) {
    int at = 0;
    for (const model::ParameterInfo& parameter : instance.effect->parameters) {
      const int count = parameter.Count(model.fingers);
      if (parameter.unit == Unit::kPixel)
        for (int i = at; i < at + count; ++i) {
          instance.values[i] /= shrink;
          for (auto& [object, values] : instance.object_values) values[i] /= shrink;
        }
      at += count;
    }
  }
  return small;
}

PhotoTrial::PhotoTrial(const DiagnosisInput& input, ThreadPool* pool) : input_(input), pool_(pool) {
  const session::ImageSet& set = *input.images;
  small_.origin = set.origin;
  small_.objects = set.objects;
  small_.camera = set.camera;
  shrink_ = std::max(1, std::max(set.camera.width_px, set.camera.height_px) / kPhotoCheckRules.small_side);
  small_.camera.width_px /= shrink_, small_.camera.height_px /= shrink_;
  for (double* length :
       {&small_.camera.fx_px, &small_.camera.fy_px, &small_.camera.cx_px, &small_.camera.cy_px})
    *length /= shrink_;
  for (size_t row = 0; row < std::min(set.size(), kPhotoCheckRules.max_small.value()); ++row)
    small_.photographs.push_back(
        Small(set.photographs[row], set.camera.width_px, set.camera.height_px, shrink_));
  rows_ = Chosen(small_);
}

std::vector<TrialPicture> PhotoTrial::Run(const session::ImageSetFix& fix, const model::Model* model,
                                          int only_object) const {
  std::vector<int> rows;
  for (const int row : rows_)
    if (only_object < 0 || small_.photographs[row].object == only_object) rows.push_back(row);
  return RunOn(rows, fix, model);
}

std::vector<TrialPicture> PhotoTrial::RunOn(const std::vector<int>& rows, const session::ImageSetFix& fix,
                                            const model::Model* model) const {
  session::ImageSet fixed = small_;
  const absl::StatusOr<std::vector<int>> left = session::ApplyFix(fix, &fixed);
  if (!left.ok()) return {};
  const image::PhotoSimulator simulator(std::make_shared<const model::Model>(
      ForSmallPictures(model == nullptr ? *input_.model : *model, shrink_)));
  std::vector<TrialPicture> pictures;
  std::vector<int> place;  // in the fixed set
  for (size_t k = 0; k < left->size(); ++k) {
    const int row = (*left)[k];
    const int object = small_.photographs[row].object;
    if (!std::binary_search(rows.begin(), rows.end(), row)) continue;
    pictures.push_back({row, object});
    place.push_back(static_cast<int>(k));
  }
  std::vector<char> failed(pictures.size(), 0);
  ParallelFor(pool_, static_cast<int>(pictures.size()), 1, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) {
      const session::PhotographRow& row = fixed.photographs[place[k]];
      const auto surface = input_.surfaces.find(fixed.objects[row.object]);
      if (surface == input_.surfaces.end()) {
        failed[k] = 1;
        continue;
      }
      const absl::StatusOr<image::Photo> expected =
          simulator.Run(RequestOf(fixed, row, surface->second), {}, nullptr);
      if (!expected.ok()) continue;  // nothing to be seen from there: not explained
      const std::vector<float> measured = fixed.Grey(place[k]);
      pictures[k].left = Left(measured, expected->grey);
      pictures[k].outline_iou = OutlineIou(measured, expected->grey);
    }
  });
  if (std::find(failed.begin(), failed.end(), 1) != failed.end()) return {};
  return pictures;
}

double RobustLeft(std::vector<TrialPicture> pictures) {
  if (pictures.empty()) return 1;
  std::sort(pictures.begin(), pictures.end(),
            [](const TrialPicture& a, const TrialPicture& b) { return a.left < b.left; });
  const size_t counts =
      std::max<size_t>(1, static_cast<size_t>(kCheckRules.counted_share * pictures.size() + 0.5));
  double sum = 0;
  for (size_t k = 0; k < counts; ++k) sum += pictures[k].left;
  return sum / counts;
}

}  // namespace touchstone::diagnosis::checks
