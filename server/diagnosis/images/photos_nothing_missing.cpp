#include "server/diagnosis/images/photos_nothing_missing.h"

#include <memory>

#include "server/base/status.h"
#include "server/diagnosis/images/photo_quality.h"
#include "server/diagnosis/images/photo_search.h"
#include "server/diagnosis/images/photo_terms.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr PhotoRowsOptions kTriedRows = {1600, 1, 15};
constexpr double kRoundingGrey = 0.3;  // what 8-bit pixels without noise are off by, about

class Tester {
 public:
  Tester(const DiagnosisInput& input, const Photographs& photographs, const std::vector<image::Photo>& before)
      : input_(input), photographs_(photographs), before_(before) {}

  absl::StatusOr<engine::TriedPValues> Run(const engine::Quality& initial, const DiagnosisContext& context) {
    PhotoRowsOptions options = kTriedRows;
    options.contour_px2 = ContourPlaceVariance(photographs_, before_, context.pool);
    TOUCHSTONE_ASSIGN_OR_RETURN(
        search_, MakePhotoSearch(photographs_, *input_.model, PhotoCandidates(input_, photographs_), options,
                                 context));
    search_.experiment->settled = input_.settled;
    TOUCHSTONE_ASSIGN_OR_RETURN(const engine::GivenAndEffects tried,
                                engine::ColumnsOfEffects(*search_.search, *input_.model));
    hypotheses_.AddEffects(*search_.rows, tried.effects);
    AddCurves();
    AddPictures();
    // What is left is what pixels are rounded to: it has no noise, and its pattern is that of rounding.
    if (initial.rmse < kRoundingGrey) return engine::AgreeingPValues(hypotheses_.size() + 1);
    const Eigen::MatrixXd linear = hypotheses_.PValues(
        engine::DataAndNoise(*search_.rows, tried.given.columns.values.col(0), input_.seed));
    engine::TriedPValues p_values = engine::TriedPValues::Ones(linear.rows() + 1, linear.cols());
    p_values.topRows(linear.rows()) = linear;
    p_values(linear.rows(), 0) = initial.lack_of_fit_p;
    return p_values;
  }

 private:
  // The terms that formulas are made of.
  void AddCurves() {
    const PhotoTermDictionary dictionary = MakePhotoTerms(photographs_);
    const int functions = static_cast<int>(dictionary.functions.size());
    std::vector<std::unique_ptr<PixelReader>> readers;
    for (int k = 0; k < photographs_.size(); ++k)
      readers.push_back(std::make_unique<PixelReader>(photographs_, *input_.model, k, before_[k]));
    const Eigen::MatrixXd added =
        search_.rows->RowsOfAdded(2 * functions, [&](int k, int column, int row, float* columns) {
          const effects::PhotoPixel pixel = readers[k]->At(column, row);
          for (int f = 0; f < functions; ++f) {
            columns[f] = static_cast<float>(dictionary.functions[f](pixel));
            columns[functions + f] = static_cast<float>(pixel.grey) * columns[f];
          }
        });
    for (const PhotoTerm& term : dictionary.terms) {
      Eigen::MatrixXd own(added.rows(), term.columns.size());
      for (size_t c = 0; c < term.columns.size(); ++c)
        own.col(static_cast<int>(c)) =
            added.col(term.columns[c].function + (term.columns[c].times_grey ? functions : 0));
      hypotheses_.Add(own);
    }
  }

  // Anything in one picture alone.
  void AddPictures() {
    const std::vector<int>& first = search_.rows->first_row();
    if (first.size() < 4) return;
    for (size_t v = 0; v + 1 < first.size(); ++v) hypotheses_.AddRows(first[v], first[v + 1] - first[v]);
  }

  const DiagnosisInput& input_;
  const Photographs& photographs_;
  const std::vector<image::Photo>& before_;
  PhotoSearch search_;
  engine::LinearHypotheses hypotheses_;
};

}  // namespace

absl::StatusOr<engine::TriedPValues> TryOnPhotographs(const DiagnosisInput& input,
                                                      const Photographs& photographs,
                                                      const std::vector<image::Photo>& before,
                                                      const engine::Quality& initial,
                                                      const DiagnosisContext& context) {
  return Tester(input, photographs, before).Run(initial, context);
}

}  // namespace touchstone::diagnosis::images
