// A dictionary of simple terms that grey levels may follow when no effect of the catalogue does: functions of what
// formulas may read of a pixel, as people would write them in a model file; selection/curves/formula_terms.h for photographs.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "server/diagnosis/images/photographs.h"
#include "server/effects/photo_settings.h"

namespace touchstone::diagnosis::images {

// A factor of a term, at one pixel.
using PixelFunction = std::function<double(const effects::PhotoPixel&)>;

// grey levels added = sum over columns of value * functions[function] (* grey, where the column is `times_grey`)
struct PhotoTerm {
  struct Column {
    int function = 0;
    bool times_grey = false;
  };
  std::string covariate;            // that it is named after
  std::string expression;           // with its parameters: "k * radius^2 + c"
  std::vector<std::string> linear;  // names of the columns' values, in their order
  std::vector<Column> columns;
  std::string fixed_name;  // "period", "tau"; empty: none
  double fixed_value = 0;
  double penalty_nats = 0;  // what people would try first costs less
};

struct PhotoTermDictionary {
  std::vector<PixelFunction> functions;
  std::vector<PhotoTerm> terms;
};

PhotoTermDictionary MakePhotoTerms(const Photographs& photographs);

// The term with values as a whole effect for a model file, values rounded to four digits.
absl::StatusOr<std::shared_ptr<const model::Effect>> MakePhotoTermEffect(const PhotoTerm& term,
                                                                         const std::vector<double>& values);

// What formulas read of the pixels of photograph k, as the simulator gives it to them. `photo` has details.
class PixelReader {
 public:
  PixelReader(const Photographs& photographs, const model::Model& model, int k, const image::Photo& photo);
  effects::PhotoPixel At(int column, int row) const;

 private:
  const image::Photo& photo_;
  double cx_px_ = 0, cy_px_ = 0, half_diagonal_px_ = 1, session_time_s_ = 0;
};

}  // namespace touchstone::diagnosis::images
