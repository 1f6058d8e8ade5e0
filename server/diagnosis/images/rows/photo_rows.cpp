#include "server/diagnosis/images/rows/photo_rows.h"

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/engine/fit/parameterization.h"
#include "server/diagnosis/images/pixels/image_field.h"
#include "server/diagnosis/images/rows/photo_view.h"
#include "server/diagnosis/images/rows/rules.h"

namespace touchstone::diagnosis::images {
namespace {

// What the model's effects make of one object's photographs, as bytes: equal for models that photograph it alike.
std::string KeyOf(const model::Model& model, const std::string& object) {
  std::string key = object;
  for (const model::EffectInstance& instance : model.effects) {
    if (!ShowsInPhotographs(*instance.effect) || instance.effect->name == kImageFieldName) continue;
    const absl::Span<const double> values = instance.ValuesFor(object);
    if (std::vector<double>(values.begin(), values.end()) == instance.effect->NeutralValues(model.fingers))
      continue;
    key += '\n' + engine::NameOf(*instance.effect) + ' ';
    key.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double));
  }
  return key;
}

}  // namespace

bool ShowsInPhotographs(const model::Effect& effect) {
  return !effect.random() && (effect.of_photos() || effect.moves_surface);
}

bool MovesRays(const model::Effect& effect) {
  return effect.moves_surface || effect.stage == model::Stage::kCameraPose ||
         effect.stage == model::Stage::kProjection;
}

PhotoRows::PhotoRows(const Photographs& photographs, ThreadPool* pool)
    : photographs_(photographs), pool_(pool) {}
PhotoRows::~PhotoRows() = default;

absl::StatusOr<std::unique_ptr<PhotoRows>> PhotoRows::Make(
    const Photographs& photographs, const model::Model& anchor,
    const std::vector<std::shared_ptr<const model::Effect>>& effects, const PhotoRowsOptions& options,
    ThreadPool* pool) {
  std::unique_ptr<PhotoRows> rows(new PhotoRows(photographs, pool));
  rows->grid_ = GridOfPicture(photographs.width(), photographs.height(), options.cells);
  const Eigen::MatrixXf functions = ImageFieldFunctions(photographs.width(), photographs.height());
  rows->field_cells_.resize(rows->grid_.size(), kImageFieldSize);
  for (int f = 0; f < kImageFieldSize; ++f)
    rows->field_cells_.col(f) = CellSums(rows->grid_, functions.col(f).data());
  rows->Choose(options.max_photographs);
  const std::vector<Direction> directions = DirectionsOf(anchor, effects);
  const int count = static_cast<int>(rows->views_.size());
  std::vector<absl::Status> statuses(count);
  ParallelFor(pool, count, 1, [&](int begin, int end) {
    for (int v = begin; v < end; ++v)
      statuses[v] = rows->MakeView(anchor, directions, options, rows->views_[v].get());
  });
  for (const absl::Status& status : statuses) TOUCHSTONE_RETURN_IF_ERROR(status);
  rows->Number(directions);
  return rows;
}

// As many of every object, spread evenly over its photographs.
void PhotoRows::Choose(int max_photographs) {
  const int objects = static_cast<int>(photographs_.objects.size());
  const int quota = std::max(max_photographs / std::max(objects, 1), 2);
  for (int object = 0; object < objects; ++object) {
    std::vector<int> own;
    for (int k = 0; k < photographs_.size(); ++k)
      if (photographs_.object[k] == object) own.push_back(k);
    const int count = static_cast<int>(own.size()), taken = std::min(count, quota);
    for (int i = 0; i < taken; ++i) {
      views_.push_back(std::make_unique<View>());
      views_.back()->k = own[(2 * i + 1) * count / (2 * taken)];
    }
  }
}

void PhotoRows::Number(const std::vector<Direction>& directions) {
  const int objects = static_cast<int>(photographs_.objects.size());
  first_row_.assign(1, 0);
  first_row_of_group_.assign(objects + 1, 0);
  for (size_t v = 0; v < views_.size(); ++v) {
    const int rows = static_cast<int>(views_[v]->basis.rows());
    photograph_of_row_.insert(photograph_of_row_.end(), rows, views_[v]->k);
    first_row_.push_back(first_row_.back() + rows);
    first_row_of_group_[photographs_.object[views_[v]->k] + 1] = first_row_.back();
  }
  for (int object = 0; object < objects; ++object)
    first_row_of_group_[object + 1] = std::max(first_row_of_group_[object + 1], first_row_of_group_[object]);
  measured_.resize(rows());
  int slopes = 0;
  for (const Direction& direction : directions)
    if (MovesRays(*direction.effect)) slope_of_[{direction.effect->name, direction.value}] = slopes++;

  albedo_.sites.resize(objects);
  albedo_.distinct_m.resize(objects);
  int sites = 0;
  for (size_t v = 0; v < views_.size(); ++v) {
    measured_.segment(first_row_[v], views_[v]->measured.size()) = views_[v]->measured;
    const int object = photographs_.object[views_[v]->k];
    for (engine::SmoothErrorSite& site : views_[v]->sites) {
      site.first_row = first_row_[v];
      albedo_.distinct_m[object].push_back(site.position_m);
      for (const double row : site.row_per_m) albedo_.mean_row_per_m += row * row;
      ++sites;
      albedo_.sites[object].push_back(std::move(site));
    }
    views_[v]->sites.clear();
  }
  albedo_.mean_row_per_m = sites > 0 ? std::sqrt(albedo_.mean_row_per_m / sites) : 1;
  for (const auto& surface : photographs_.surfaces)
    albedo_.size_m += (surface->bounds().max_m - surface->bounds().min_m).maxCoeff() / objects;
}

std::vector<double> PhotoRows::Predict(const model::Model& model, const std::vector<int>& unread,
                                       ThreadPool* pool) const {
  std::vector<double> predicted(rows());
  std::vector<std::shared_ptr<const std::vector<double>>> parts(photographs_.objects.size());
  std::vector<std::string> keys;
  std::vector<int> missing;  // views
  std::vector<int> unread_of(views_.size(), 0);
  for (const int row : unread)
    ++unread_of[std::upper_bound(first_row_.begin(), first_row_.end(), row) - first_row_.begin() - 1];
  std::vector<bool> whole(parts.size(), true);  // whether all of an object is read
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (size_t object = 0; object < parts.size(); ++object) {
      keys.push_back(KeyOf(model, photographs_.objects[object]));
      if (const auto found = known_.find(keys[object]); found != known_.end()) parts[object] = found->second;
    }
  }
  for (size_t v = 0; v < views_.size(); ++v) {
    const int object = photographs_.object[views_[v]->k];
    if (parts[object] != nullptr) continue;
    const bool skipped = unread_of[v] > 0 && unread_of[v] == first_row_[v + 1] - first_row_[v];
    if (!skipped) missing.push_back(static_cast<int>(v));
    whole[object] = whole[object] && !skipped;
  }
  const image::PhotoSimulator simulator(std::make_shared<const model::Model>(model));
  ParallelFor(pool, static_cast<int>(missing.size()), 1, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      const int v = missing[i];
      Eigen::Map<Eigen::VectorXd>(&predicted[first_row_[v]], first_row_[v + 1] - first_row_[v]) =
          Expect(simulator, *views_[v]);
    }
  });
  for (size_t object = 0; object < parts.size(); ++object) {
    const int begin = first_row_of_group_[object], end = first_row_of_group_[object + 1];
    if (parts[object] != nullptr) {
      std::copy(parts[object]->begin(), parts[object]->end(), predicted.begin() + begin);
      continue;
    }
    if (!whole[object]) continue;
    const std::lock_guard<std::mutex> lock(mutex_);
    known_[keys[object]] =
        std::make_shared<const std::vector<double>>(predicted.begin() + begin, predicted.begin() + end);
  }
  for (const model::EffectInstance& instance : model.effects) {
    if (instance.effect->name != kImageFieldName) continue;
    const Eigen::Map<const Eigen::VectorXd> values(instance.values.data(), kImageFieldSize);
    for (size_t v = 0; v < views_.size(); ++v)
      Eigen::Map<Eigen::VectorXd>(&predicted[first_row_[v]], first_row_[v + 1] - first_row_[v]) +=
          views_[v]->field * values;
  }
  return predicted;
}

Eigen::VectorXd PhotoRows::Expect(const image::PhotoSimulator& simulator, const View& view) const {
  const std::lock_guard<std::mutex> lock(view.mutex);
  absl::StatusOr<image::Photo> photo =
      simulator.Run(photographs_.requests[view.k], image::PhotoOutputs(), &view.workspace);
  if (!photo.ok()) return view.measured.array() + kPhotoRowRules.far_rows.value();
  ToRecordedMeans(*photographs_.record, &*photo);
  return view.Project(grid_, photo->grey);
}

absl::StatusOr<std::vector<double>> PhotoRows::Predict(const model::Model& model) const {
  return Predict(model, {}, pool_);
}

absl::StatusOr<std::vector<double>> PhotoRows::PredictOthers(const model::Model& model,
                                                             const std::vector<int>& unread) const {
  return Predict(model, unread, pool_);
}

absl::StatusOr<std::vector<double>> PhotoRows::PredictNear(const model::Model& moved, const model::Model& at,
                                                           const std::vector<double>& predicted) const {
  return PredictOthersNear(moved, at, predicted, {});
}

absl::StatusOr<std::vector<double>> PhotoRows::PredictOthersNear(const model::Model& moved,
                                                                 const model::Model& at,
                                                                 const std::vector<double>& predicted,
                                                                 const std::vector<int>& unread) const {
  std::vector<double> near = predicted;
  for (size_t e = 0; e < moved.effects.size(); ++e) {
    const model::Effect& effect = *moved.effects[e].effect;
    if (!ShowsInPhotographs(effect)) continue;
    for (size_t v = 0; v < views_.size(); ++v) {
      const std::string& object = photographs_.objects[photographs_.object[views_[v]->k]];
      const absl::Span<const double> to = moved.effects[e].ValuesFor(object),
                                     from = at.effects[e].ValuesFor(object);
      for (size_t value = 0; value < to.size(); ++value) {
        if (to[value] == from[value]) continue;
        const double step = to[value] - from[value];
        Eigen::Map<Eigen::VectorXd> rows(&near[first_row_[v]], first_row_[v + 1] - first_row_[v]);
        if (effect.name == kImageFieldName) {
          rows += step * views_[v]->field.col(static_cast<int>(value));
          continue;
        }
        const auto slope = slope_of_.find({effect.name, static_cast<int>(value)});
        if (slope == slope_of_.end()) return Predict(moved, unread, nullptr);
        rows += step * views_[v]->slopes.col(slope->second);
      }
    }
  }
  return near;
}

Eigen::VectorXd PhotoRows::Residual(const std::vector<double>& predicted) const {
  return measured_ - Eigen::Map<const Eigen::VectorXd>(predicted.data(), rows());
}

Eigen::VectorXd PhotoRows::Change(const std::vector<double>& predicted,
                                  const std::vector<double>& moved) const {
  return Eigen::Map<const Eigen::VectorXd>(moved.data(), rows()) -
         Eigen::Map<const Eigen::VectorXd>(predicted.data(), rows());
}

}  // namespace touchstone::diagnosis::images
