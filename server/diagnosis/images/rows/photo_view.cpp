#include "server/diagnosis/images/rows/photo_view.h"

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/engine/fit/parameterization.h"
#include "server/diagnosis/images/pixels/image_field.h"
#include "server/diagnosis/images/rows/photo_flow.h"
#include "server/diagnosis/images/rows/rules.h"
#include "server/model/parameter_values.h"

namespace touchstone::diagnosis::images {
namespace {

// Moves one flat value, of every object.
void MoveValue(model::EffectInstance* instance, int value, double step, double lower, double upper) {
  const auto move = [&](std::vector<double>& values) {
    values[value] = std::clamp(values[value] + step, lower, upper);
  };
  move(instance->values);
  for (auto& [object, values] : instance->object_values) move(values);
}

// The flat value's parameter.
const model::ParameterInfo& ParameterOf(const model::Effect& effect, int fingers, int value) {
  int next = 0;
  for (const model::ParameterInfo& parameter : effect.parameters) {
    next += parameter.Count(fingers);
    if (value < next) return parameter;
  }
  return effect.parameters.back();
}

}  // namespace

void PhotoRows::View::SetAnchor(const CellGrid& grid, const std::vector<float>& grey) {
  cells_at_anchor = CellSums(grid, grey.data());
  rows_at_anchor = (basis * cells_at_anchor.cwiseProduct(weights)).cast<double>();
}

Eigen::VectorXd PhotoRows::View::Project(const CellGrid& grid, const std::vector<float>& grey) const {
  // From the anchor's picture, whose ground most models share.
  const Eigen::VectorXf change = CellSums(grid, grey.data()) - cells_at_anchor;
  Eigen::VectorXd rows = rows_at_anchor;
  const int cells = grid.size();
  for (int begin = 0; begin < cells;) {
    if (change[begin] == 0) {
      ++begin;
      continue;
    }
    int end = begin + 1;
    while (end < cells && end - begin < kPhotoRowRules.max_run && change[end] != 0) ++end;
    const int run = end - begin;
    rows +=
        (basis.middleCols(begin, run) * change.segment(begin, run).cwiseProduct(weights.segment(begin, run)))
            .cast<double>();
    begin = end;
  }
  return rows;
}

std::vector<PhotoRows::Direction> PhotoRows::DirectionsOf(
    const model::Model& anchor, const std::vector<std::shared_ptr<const model::Effect>>& effects) {
  std::vector<std::shared_ptr<const model::Effect>> all;
  for (const model::EffectInstance& instance : anchor.effects) all.push_back(instance.effect);
  for (const auto& effect : effects)
    if (std::none_of(all.begin(), all.end(),
                     [&](const auto& other) { return engine::NameOf(*other) == engine::NameOf(*effect); }))
      all.push_back(effect);
  std::vector<Direction> directions;
  for (size_t e = 0; e < all.size(); ++e) {
    const model::Effect& effect = *all[e];
    if (!ShowsInPhotographs(effect) || effect.parameters.empty() || effect.name == kImageFieldName) continue;
    Direction direction;
    direction.effect = all[e];
    direction.base = anchor;
    direction.instance = static_cast<int>(e);
    if (e >= anchor.effects.size()) {
      direction.instance = static_cast<int>(anchor.effects.size());
      model::EffectInstance instance;
      instance.effect = all[e];
      instance.values = effect.NeutralValues(anchor.fingers);
      direction.base.effects.push_back(std::move(instance));
    }
    const bool rays = MovesRays(effect);
    const int values = effect.ValueCount(anchor.fingers);
    for (int value = 0; value < values; ++value) {
      const model::ParameterInfo& parameter = ParameterOf(effect, anchor.fingers, value);
      const double si = SiFactor(parameter.unit);
      direction.value = value;
      direction.lower = parameter.lower * si, direction.upper = parameter.upper * si;
      direction.step = (rays ? kPhotoRowRules.ray_step.value() : kPhotoRowRules.sensor_step.value()) *
                       parameter.typical * si;
      const double now = direction.base.effects[direction.instance].values[value];
      if (now + direction.step > direction.upper) direction.step = -direction.step;
      direction.moved = direction.base;
      MoveValue(&direction.moved.effects[direction.instance], value, direction.step, direction.lower,
                direction.upper);
      directions.push_back(direction);
    }
    // Where the last parameter changes nothing until the first does (a direction, an exponent).
    if (rays || effect.parameters.size() < 2) continue;
    const model::ParameterInfo &first = effect.parameters.front(), &last = effect.parameters.back();
    for (const double times : {-1.0, 1.0, 2.0}) {
      direction.value = -1;
      direction.moved = direction.base;
      model::EffectInstance& instance = direction.moved.effects[direction.instance];
      MoveValue(&instance, 0, kPhotoRowRules.sensor_step * first.typical * SiFactor(first.unit),
                first.lower * SiFactor(first.unit), first.upper * SiFactor(first.unit));
      MoveValue(&instance, values - 1, times * last.typical * SiFactor(last.unit),
                last.lower * SiFactor(last.unit), last.upper * SiFactor(last.unit));
      directions.push_back(direction);
    }
  }
  return directions;
}

// The columns that a view's basis spans, gathered one after the other.
class DirectionColumns {
 public:
  DirectionColumns(const CellGrid& grid, const Eigen::VectorXf& weights, int smoothing)
      : grid_(grid), weights_(weights), smoothing_(smoothing) {}

  // Returns the weighted cells of the image before they are smoothed.
  Eigen::VectorXf Add(const std::vector<float>& image) { return AddSums(CellSums(grid_, image.data())); }
  // The same of an image that was summed over cells.
  Eigen::VectorXf AddSums(const Eigen::VectorXf& sums) {
    Eigen::VectorXf cells = sums.cwiseProduct(weights_);
    Eigen::VectorXf smooth = cells;
    for (int pass = 0; pass < smoothing_; ++pass) smooth = Smooth(grid_, smooth);
    columns_.push_back(std::move(smooth));
    return cells;
  }
  Eigen::MatrixXf All() const {
    Eigen::MatrixXf all(grid_.size(), columns_.size());
    for (size_t c = 0; c < columns_.size(); ++c) all.col(static_cast<int>(c)) = columns_[c];
    return all;
  }

 private:
  const CellGrid& grid_;
  const Eigen::VectorXf& weights_;
  int smoothing_;
  std::vector<Eigen::VectorXf> columns_;
};

namespace {

// Smooth displacements of the picture: nameless optics, up to second order of the place.
void AddDisplacements(const std::vector<float>& grey, int width, int height, DirectionColumns* columns) {
  std::vector<float> image(grey.size());
  for (int axis = 0; axis < 2; ++axis)
    for (int order = 0; order < 6; ++order) {
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
          const auto at = [&](int column, int row) {
            return grey[static_cast<size_t>(std::clamp(row, 0, height - 1)) * width +
                        std::clamp(column, 0, width - 1)];
          };
          const double slope = axis == 0 ? at(x + 1, y) - at(x - 1, y) : at(x, y + 1) - at(x, y - 1);
          const double u = 2 * (x + 0.5) / width - 1, v = 2 * (y + 0.5) / height - 1;
          const double terms[] = {1, u, v, u * u, u * v, v * v};
          image[static_cast<size_t>(y) * width + x] = static_cast<float>(0.5 * slope * terms[order]);
        }
      columns->Add(image);
    }
}

// Smooth light over the object: nameless albedo or lamps.
void AddObjectLight(const image::Photo& photo, DirectionColumns* columns) {
  std::vector<float> image(photo.grey.size()), along(photo.width);
  for (int across = 0; across <= kPhotoRowRules.object_waves; ++across) {
    for (int x = 0; x < photo.width; ++x)
      along[x] = static_cast<float>(std::cos(2 * M_PI * across * (x + 0.5) / photo.width));
    for (int down = 0; down <= kPhotoRowRules.object_waves; ++down) {
      for (int y = 0; y < photo.height; ++y) {
        const auto here = static_cast<float>(std::cos(2 * M_PI * down * (y + 0.5) / photo.height));
        for (int x = 0; x < photo.width; ++x) {
          const size_t at = static_cast<size_t>(y) * photo.width + x;
          image[at] = photo.mask[at] == 0 ? 0 : photo.grey[at] * along[x] * here;
        }
      }
      columns->Add(image);
    }
  }
}

// Patches of the surface as the picture sees them: where a smooth error of the albedo enters the rows.
std::vector<engine::SmoothErrorSite> AlbedoSites(const CellGrid& grid, const image::Photo& photo,
                                                 const Eigen::VectorXf& weights,
                                                 const Eigen::MatrixXf& basis) {
  const int side = std::max(kPhotoRowRules.patch_px / grid.cell, 1);  // cells
  std::vector<engine::SmoothErrorSite> sites;
  for (int top = 0; top < grid.rows(); top += side)
    for (int left = 0; left < grid.columns(); left += side) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      Eigen::VectorXf row = Eigen::VectorXf::Zero(basis.rows());
      int seen = 0;
      for (int cy = top; cy < std::min(top + side, grid.rows()); ++cy)
        for (int cx = left; cx < std::min(left + side, grid.columns()); ++cx) {
          float light = 0;
          for (int y = cy * grid.cell; y < std::min((cy + 1) * grid.cell, grid.height); ++y)
            for (int x = cx * grid.cell; x < std::min((cx + 1) * grid.cell, grid.width); ++x) {
              const size_t at = static_cast<size_t>(y) * grid.width + x;
              if (photo.mask[at] == 0) continue;
              light += photo.grey[at];
              sum += photo.point_m[at].cast<double>();
              ++seen;
            }
          const int cell = cy * grid.columns() + cx;
          if (light > 0) row += light * weights[cell] * basis.col(cell);
        }
      if (seen < kPhotoRowRules.min_patch_share * side * side * grid.cell * grid.cell) continue;
      engine::SmoothErrorSite site;
      site.position_m = sum / seen;
      for (int q = 0; q < row.size(); ++q) site.row_per_m.push_back(row[q]);
      sites.push_back(std::move(site));
    }
  return sites;
}

}  // namespace

absl::Status PhotoRows::MakeView(const model::Model& anchor, const std::vector<Direction>& directions,
                                 const PhotoRowsOptions& options, View* view) const {
  const image::PhotoRequest& request = photographs_.requests[view->k];
  const int width = grid_.width, height = grid_.height;
  image::PhotoWorkspace workspace;
  const auto simulate = [&](const model::Model& model, bool details) {
    image::PhotoOutputs outputs;
    outputs.details = details;
    return image::PhotoSimulator(std::make_shared<const model::Model>(model))
        .Run(request, outputs, &workspace);
  };
  TOUCHSTONE_ASSIGN_OR_RETURN(image::Photo photo, simulate(anchor, true));
  ToRecordedMeans(*photographs_.record, &photo);
  view->weights = CellWeights(grid_, photo.grey, *photographs_.record, options.contour_px2);
  const std::vector<float> contours = ContourSquares(photo.grey, width, height);
  DirectionColumns columns(grid_, view->weights, options.smoothing);
  std::vector<Eigen::VectorXf> slopes;
  // What moves no rays first: the workspace keeps them.
  for (const bool rays : {false, true})
    for (const Direction& direction : directions) {
      if (MovesRays(*direction.effect) != rays) continue;
      std::vector<float> change(photo.grey.size(), 0.0f);
      double step = direction.step;
      model::Model moved = direction.moved;
      PictureFlow flow;
      if (rays && direction.value >= 0) {
        flow = FlowOfPicture(request, photo, contours,
                             image::PhotoSimulator(std::make_shared<const model::Model>(direction.base)),
                             image::PhotoSimulator(std::make_shared<const model::Model>(direction.moved)));
        if (flow.farthest_px > kPhotoRowRules.step_px) {
          const float share = static_cast<float>(kPhotoRowRules.step_px) / flow.farthest_px;
          step *= share;
          for (Eigen::Vector2f& move_px : flow.move_px) move_px *= share;
          moved = direction.base;
          MoveValue(&moved.effects[direction.instance], direction.value, step, direction.lower,
                    direction.upper);
        }
      }
      if (absl::StatusOr<image::Photo> there = simulate(moved, false); there.ok()) {
        ToRecordedMeans(*photographs_.record, &*there);
        const std::vector<float>& grey = there->grey;
        for (size_t i = 0; i < grey.size(); ++i) change[i] = grey[i] - photo.grey[i];
        if (!flow.move_px.empty()) {
          const std::vector<float> carried = CarriedBy(flow, photo, photo.grey);
          for (size_t i = 0; i < grey.size(); ++i)
            if (contours[i] > 0) change[i] = carried[i];
        }
      }
      const Eigen::VectorXf cells = columns.Add(change);
      if (rays) slopes.push_back(cells / static_cast<float>(step));
    }
  std::vector<Eigen::VectorXf> field;
  for (int f = 0; f < kImageFieldSize; ++f) field.push_back(columns.AddSums(field_cells_.col(f)));
  AddDisplacements(photo.grey, width, height, &columns);
  AddObjectLight(photo, &columns);

  view->basis = OrthonormalSpan(columns.All(), kPhotoRowRules.span_tolerance).transpose();
  view->SetAnchor(grid_, photo.grey);
  view->slopes.resize(view->basis.rows(), slopes.size());
  for (size_t s = 0; s < slopes.size(); ++s)
    view->slopes.col(static_cast<int>(s)) = (view->basis * slopes[s]).cast<double>();
  view->field.resize(view->basis.rows(), kImageFieldSize);
  for (int f = 0; f < kImageFieldSize; ++f) view->field.col(f) = (view->basis * field[f]).cast<double>();
  view->measured = view->Project(grid_, photographs_.measured_grey[view->k]);
  view->sites = AlbedoSites(grid_, photo, view->weights, view->basis);
  return absl::OkStatus();
}

}  // namespace touchstone::diagnosis::images
