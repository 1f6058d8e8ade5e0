#include "server/diagnosis/images/photos_nothing_missing.h"

#include <memory>

#include "server/base/decompositions.h"
#include "server/base/status.h"
#include "server/diagnosis/images/photo_quality.h"
#include "server/diagnosis/images/photo_terms.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr double kNoiseStep = 0.1, kNoChange = 1e-3;
constexpr double kRoundingGrey = 0.3;  // what 8-bit pixels without noise are off by, about

class PhotoTester {
 public:
  PhotoTester(const DiagnosisInput& input, const Photographs& photographs, const PhotoSearch& search,
              ThreadPool* pool)
      : input_(input), photographs_(photographs), search_(search), rows_(*search.rows), pool_(pool) {}

  absl::StatusOr<engine::TriedPValues> Run() {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<image::Photo> as_rows,
                                ExpectPhotographs(photographs_, *input_.model, false, pool_));
    // The noise is that of what the given model leaves.
    noisy_ = photographs_;
    noisy_.noise = NoiseOfResiduals(photographs_, as_rows, pool_);
    noisy_.record = std::make_shared<const RecordTable>(noisy_.noise);
    TOUCHSTONE_ASSIGN_OR_RETURN(expected_, ExpectPhotographs(noisy_, *input_.model, true, pool_));
    TOUCHSTONE_ASSIGN_OR_RETURN(engine::GivenAndEffects tried,
                                engine::ColumnsOfEffects(*search_.search, *input_.model));
    factors_ =
        rows_.NoiseFactors(*noisy_.record, ContourPlaceVariance(noisy_, expected_, pool_), expected_);
    TOUCHSTONE_RETURN_IF_ERROR(FindNoiseSize());
    hypotheses_ = engine::LinearHypotheses(static_cast<int>(noise_size_.cols()));
    for (engine::EffectColumns& effect : tried.effects) effect.columns = Kept(std::move(effect.columns));
    hypotheses_.AddEffects(rows_, tried.effects);
    AddCurves();
    AddPictures();
    engine::Quality quality = QualityOfPhotographs(noisy_, expected_, 0, pool_);
    // What is left is what pixels are rounded to: it has no noise, and its pattern is that of rounding.
    if (quality.rmse < kRoundingGrey) return engine::AgreeingPValues(hypotheses_.size() + 1);
    AssessByPixels(noisy_, NoiseFloorOfPhotographs(noisy_, expected_, pool_), &quality);
    const Eigen::VectorXd residual =
        Kept(tried.given.columns.values.col(0) - rows_.RowsOfChange(as_rows, expected_));
    const Eigen::MatrixXd linear = hypotheses_.PValues(engine::DataAndNoise(rows_, residual, input_.seed));
    engine::TriedPValues p_values = engine::TriedPValues::Ones(linear.rows() + 1, linear.cols());
    p_values.topRows(linear.rows()) = linear;
    p_values(linear.rows(), 0) = quality.lack_of_fit_p;
    return p_values;
  }

 private:
  // Rows in which the noise is white.
  Eigen::MatrixXd Whitened(Eigen::MatrixXd columns) const {
    if (columns.cols() == 0) return columns;
    const std::vector<int>& first = rows_.first_row();
    for (size_t v = 0; v < factors_.size(); ++v) {
      auto own = columns.middleRows(first[v], first[v + 1] - first[v]);
      factors_[v].triangularView<Eigen::Lower>().solveInPlace(own);
    }
    return columns;
  }

  // How bright a clipped pixel is depends on the size of the noise, which is no hypothesis: sigma, then gain.
  absl::Status FindNoiseSize() {
    Eigen::MatrixXd changes(rows_.rows(), 2);
    for (int value = 0; value < 2; ++value) {
      Photographs other = noisy_;
      (value == 0 ? other.noise.sigma_grey : other.noise.gain) += kNoiseStep;
      other.record = std::make_shared<const RecordTable>(other.noise);
      TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<image::Photo> noisier,
                                  ExpectPhotographs(other, *input_.model, false, pool_));
      changes.col(value) = rows_.RowsOfChange(expected_, noisier);
    }
    changes = Whitened(std::move(changes));
    for (int value = 0; value < 2; ++value)
      if (changes.col(value).norm() > kNoChange) {
        noise_size_.conservativeResize(rows_.rows(), noise_size_.cols() + 1);
        noise_size_.rightCols(1) = changes.col(value).normalized();
      }
    if (noise_size_.cols() > 0) noise_size_ = ColumnSpan(noise_size_).Basis();
    return absl::OkStatus();
  }

  Eigen::MatrixXd WithoutNoiseSize(Eigen::MatrixXd columns) const {
    if (columns.cols() == 0 || noise_size_.cols() == 0) return columns;
    return columns - noise_size_ * (noise_size_.transpose() * columns);
  }
  Eigen::MatrixXd Kept(Eigen::MatrixXd columns) const {
    return WithoutNoiseSize(Whitened(std::move(columns)));
  }

  // The terms that formulas are made of.
  void AddCurves() {
    const PhotoTermDictionary dictionary = MakePhotoTerms(photographs_);
    const int functions = static_cast<int>(dictionary.functions.size());
    std::vector<std::unique_ptr<PixelReader>> readers;
    for (int k = 0; k < photographs_.size(); ++k)
      readers.push_back(std::make_unique<PixelReader>(photographs_, *input_.model, k, expected_[k]));
    const Eigen::MatrixXd added =
        Kept(rows_.RowsOfAdded(2 * functions, [&](int k, int column, int row, float* columns) {
          const effects::PhotoPixel pixel = readers[k]->At(column, row);
          for (int f = 0; f < functions; ++f) {
            columns[f] = static_cast<float>(dictionary.functions[f](pixel));
            columns[functions + f] = static_cast<float>(pixel.grey) * columns[f];
          }
        }));
    for (const PhotoTerm& term : dictionary.terms) {
      Eigen::MatrixXd own(added.rows(), term.columns.size());
      for (size_t c = 0; c < term.columns.size(); ++c)
        own.col(static_cast<int>(c)) =
            added.col(term.columns[c].function + (term.columns[c].times_grey ? functions : 0));
      hypotheses_.Add(own);
    }
  }

  // Anything in one picture alone, of three or more.
  void AddPictures() {
    const std::vector<int>& first = rows_.first_row();
    if (first.size() < 4) return;
    for (size_t v = 0; v + 1 < first.size(); ++v) hypotheses_.AddRows(first[v], first[v + 1] - first[v]);
  }

  const DiagnosisInput& input_;
  const Photographs& photographs_;
  const PhotoSearch& search_;
  const PhotoRows& rows_;
  ThreadPool* pool_;
  std::vector<image::Photo> expected_;    // of the given model, with details
  std::vector<Eigen::MatrixXd> factors_;  // of the noise of each photograph's rows
  Eigen::MatrixXd noise_size_;  // orthonormal
  engine::LinearHypotheses hypotheses_;
};

}  // namespace

absl::StatusOr<engine::TriedPValues> TryOnPhotographs(const DiagnosisInput& input,
                                                      const Photographs& photographs,
                                                      const PhotoSearch& search,
                                                      const DiagnosisContext& context) {
  return PhotoTester(input, photographs, search, context.pool).Run();
}

}  // namespace touchstone::diagnosis::images
