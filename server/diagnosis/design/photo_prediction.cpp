#include "server/diagnosis/design/photo_prediction.h"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/design/rules.h"
#include "server/diagnosis/engine/fit/parameterization.h"
#include "server/diagnosis/images/pixels/photo_cells.h"
#include "server/diagnosis/images/rows/photo_rows.h"

namespace touchstone::diagnosis::design {
namespace {

// One model with everything free that photographs show, and where its simulators stand.
struct FreeModel {
  engine::Parameterization free;
  std::unique_ptr<image::PhotoSimulator> here;
  struct Value {
    std::string object;  // whose value; empty: of all
    bool rays = false;
    double width = 0;  // between the sides, in scales
    std::unique_ptr<image::PhotoSimulator> side[2];
  };
  std::vector<Value> values;
};

FreeModel MakeFreeModel(const model::Model& model, const std::vector<std::string>& objects) {
  FreeModel made;
  made.free = engine::Parameterization(model, objects);
  for (size_t e = 0; e < model.effects.size(); ++e)
    if (images::ShowsInPhotographs(*model.effects[e].effect)) made.free.Free(static_cast<int>(e), true);
  made.here = std::make_unique<image::PhotoSimulator>(std::make_shared<const model::Model>(made.free.base()));
  const Eigen::VectorXd start = made.free.Start();
  for (int c = 0; c < made.free.size(); ++c) {
    const engine::FreeParameter& parameter = made.free.parameters()[c];
    FreeModel::Value value;
    value.object = parameter.object;
    value.rays = images::MovesRays(*model.effects[parameter.effect].effect);
    double at[2];
    for (const int side : {0, 1}) {
      Eigen::VectorXd point = start;
      point[c] += (side == 0 ? -1 : 1) *
                  (value.rays ? kDesignRules.ray_steps.value() : kDesignRules.sensor_steps.value()) *
                  parameter.scale;
      point = made.free.Clip(point);
      at[side] = point[c];
      value.side[side] =
          std::make_unique<image::PhotoSimulator>(std::make_shared<const model::Model>(made.free.At(point)));
    }
    value.width = (at[1] - at[0]) / parameter.scale;
    made.values.push_back(std::move(value));
  }
  return made;
}

// A picture as one model expects it, in cells: sums over their noise.
struct ExpectedCells {
  Eigen::VectorXf cells;
  Eigen::MatrixXf slopes;  // cells x values
};

class PhotoPredictor {
 public:
  PhotoPredictor(const std::vector<std::shared_ptr<const model::Model>>& models,
                 const images::Photographs& present, const images::PixelNoise& noise)
      : present_(present) {
    for (const auto& model : models) models_.push_back(MakeFreeModel(*model, present.objects));
    const int max_side_px = kDesignRules.max_side_px;
    shrink_ = std::max(1, (std::max(present.width(), present.height()) + max_side_px - 1) / max_side_px);
    images::PixelNoise smaller = noise;
    smaller.sigma_grey = std::max(noise.sigma_grey, kDesignRules.min_sigma_grey.value()) / shrink_;
    smaller.gain = noise.gain / (shrink_ * shrink_);
    record_ = std::make_unique<images::RecordTable>(smaller);
    grid_ = images::GridOfPicture(std::max(present.width() / shrink_, 1),
                                  std::max(present.height() / shrink_, 1), kDesignRules.cells);
    last_s_ = 0;
    for (const image::PhotoRequest& request : present.requests)
      last_s_ = std::max(last_s_, request.session_time_s);
  }

  const std::vector<FreeModel>& models() const { return models_; }

  image::PhotoRequest RequestOfPresent(int k) const { return Smaller(present_.requests[k]); }
  image::PhotoRequest RequestOf(const ViewCandidate& view) const {
    const auto first = std::find(present_.object.begin(), present_.object.end(), view.object);
    image::PhotoRequest request = present_.requests[first - present_.object.begin()];
    request.camera = image::Camera();
    request.camera.eye_m = view.camera.eye_m;
    request.camera.at_m = view.camera.at_m;
    request.camera.up = view.camera.up;
    request.session_time_s = last_s_;
    return Smaller(request);
  }

  // Of every model; none where the object is not well in the picture of the first (`checked`) or a model has none.
  std::vector<ExpectedCells> Expect(const image::PhotoRequest& request, bool checked) const {
    std::vector<ExpectedCells> all;
    std::vector<image::PhotoWorkspace> workspaces(models_.size());
    std::vector<std::vector<float>> here;
    for (size_t m = 0; m < models_.size(); ++m) {
      const absl::StatusOr<image::Photo> photo =
          models_[m].here->Run(request, image::PhotoOutputs(), &workspaces[m]);
      if (!photo.ok() || (checked && m == 0 && !IsWellInPicture(*photo))) return {};
      here.push_back(Recorded(*photo));
    }
    const Eigen::VectorXf weights = images::CellWeights(grid_, here[0], *record_);
    for (size_t m = 0; m < models_.size(); ++m) {
      ExpectedCells expected;
      expected.cells = images::CellSums(grid_, here[m].data(), weights);
      expected.slopes = Eigen::MatrixXf::Zero(grid_.size(), models_[m].values.size());
      // What moves no rays first: the workspace keeps them.
      for (const bool rays : {false, true})
        for (size_t c = 0; c < models_[m].values.size(); ++c) {
          const FreeModel::Value& value = models_[m].values[c];
          if (value.rays != rays || !(value.width > 0) ||
              (!value.object.empty() && value.object != request.object))
            continue;
          const auto low = value.side[0]->Run(request, image::PhotoOutputs(), &workspaces[m]),
                     high = value.side[1]->Run(request, image::PhotoOutputs(), &workspaces[m]);
          if (!low.ok() || !high.ok()) continue;
          std::vector<float> change = Recorded(*high);
          const std::vector<float> from = Recorded(*low);
          for (size_t i = 0; i < change.size(); ++i) change[i] -= from[i];
          expected.slopes.col(static_cast<int>(c)) =
              images::CellSums(grid_, change.data(), weights) / static_cast<float>(value.width);
        }
      all.push_back(std::move(expected));
    }
    return all;
  }

  // Orthonormal directions of the cells along which any value of any model moves the picture; smooth, so that they hold
  // little of the grain of contours that are sampled at pixel centres.
  Eigen::MatrixXf Basis(const std::vector<ExpectedCells>& all) const {
    int columns = 0;
    for (const ExpectedCells& expected : all) columns += static_cast<int>(expected.slopes.cols());
    Eigen::MatrixXf spanned(grid_.size(), columns);
    int next = 0;
    for (const ExpectedCells& expected : all)
      for (int c = 0; c < expected.slopes.cols(); ++c)
        spanned.col(next++) = images::Smooth(grid_, expected.slopes.col(c));
    return images::OrthonormalSpan(spanned, kDesignRules.span_tolerance);
  }

 private:
  image::PhotoRequest Smaller(image::PhotoRequest request) const {
    image::Intrinsics& lens = request.lens;
    lens.width = grid_.width, lens.height = grid_.height;
    for (double* value : {&lens.fx_px, &lens.fy_px, &lens.cx_px, &lens.cy_px}) *value /= shrink_;
    return request;
  }

  std::vector<float> Recorded(const image::Photo& photo) const {
    std::vector<float> grey = photo.grey;
    record_->ToMeans(&grey);
    return grey;
  }

  bool IsWellInPicture(const image::Photo& photo) const {
    int shown = 0;
    for (int y = 0; y < photo.height; ++y)
      for (int x = 0; x < photo.width; ++x) {
        if (photo.mask[static_cast<size_t>(y) * photo.width + x] == 0) continue;
        if (x == 0 || y == 0 || x == photo.width - 1 || y == photo.height - 1) return false;
        ++shown;
      }
    return shown > kDesignRules.min_shown_share * photo.width * photo.height;
  }

  const images::Photographs& present_;
  std::vector<FreeModel> models_;
  int shrink_ = 1;
  std::unique_ptr<images::RecordTable> record_;
  images::CellGrid grid_;
  double last_s_ = 0;
};

}  // namespace

absl::StatusOr<std::vector<LinearisedPrediction>> LinearisePhotographs(
    const std::vector<std::shared_ptr<const model::Model>>& models, const images::Photographs& present,
    const images::PixelNoise& noise, const std::vector<ViewCandidate>& candidates, ThreadPool* pool) {
  const PhotoPredictor predictor(models, present, noise);
  const size_t count = models.size();
  // What the present data say of the values.
  const int max_present = kDesignRules.max_present_photographs;
  const int stride = (present.size() + max_present - 1) / max_present;
  std::vector<int> kept;
  for (int k = 0; k < present.size(); k += std::max(stride, 1)) kept.push_back(k);
  std::vector<std::vector<Eigen::MatrixXd>> known(kept.size());
  ParallelFor(pool, static_cast<int>(kept.size()), 1, [&](int begin, int end) {
    for (int i = begin; i < end; ++i)
      for (const ExpectedCells& expected : predictor.Expect(predictor.RequestOfPresent(kept[i]), false)) {
        const Eigen::MatrixXd slopes = expected.slopes.cast<double>();
        known[i].push_back(slopes.transpose() * slopes);
      }
  });
  std::vector<LinearisedPrediction> predictions(count);
  const double weight = static_cast<double>(present.size()) / static_cast<double>(kept.size());
  for (size_t m = 0; m < count; ++m) {
    const int size = predictor.models()[m].free.size();
    Eigen::MatrixXd information = Eigen::MatrixXd::Identity(size, size);  // the priors'
    for (const auto& of_models : known)
      if (!of_models.empty()) information += weight * of_models[m];
    predictions[m].covariance = information.llt().solve(Eigen::MatrixXd::Identity(size, size));
    predictions[m].predicted.resize(candidates.size());
    predictions[m].derivative.resize(candidates.size());
  }
  ParallelFor(pool, static_cast<int>(candidates.size()), 1, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) {
      const std::vector<ExpectedCells> all = predictor.Expect(predictor.RequestOf(candidates[k]), true);
      if (all.empty()) {
        for (size_t m = 0; m < count; ++m) {
          predictions[m].predicted[k] = Eigen::VectorXd::Constant(1, NAN);
          predictions[m].derivative[k] = Eigen::MatrixXd::Zero(1, predictor.models()[m].free.size());
        }
        continue;
      }
      const Eigen::MatrixXf basis = predictor.Basis(all);
      for (size_t m = 0; m < count; ++m) {
        // From the first model's picture, which all share: differences of large numbers are taken once.
        predictions[m].predicted[k] = (basis.transpose() * (all[m].cells - all[0].cells)).cast<double>();
        predictions[m].derivative[k] = (basis.transpose() * all[m].slopes).cast<double>();
      }
    }
  });
  return predictions;
}

}  // namespace touchstone::diagnosis::design
