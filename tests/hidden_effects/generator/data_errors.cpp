#include "tests/hidden_effects/generator/data_errors.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <sstream>
#include <stdexcept>

namespace touchstone::hidden {
namespace {

using Row = std::vector<std::string>;

Row Split(const std::string& line) {
  Row cells(1);
  for (const char c : line)
    if (c == ',')
      cells.emplace_back();
    else
      cells.back() += c;
  return cells;
}

std::string Text(double value) {
  char text[32];
  snprintf(text, sizeof text, "%.10g", value);
  return text;
}

struct CsvTable {
  Row header;
  std::vector<Row> rows;

  explicit CsvTable(const std::string& csv) {
    std::istringstream lines(csv);
    std::string line;
    std::getline(lines, line);
    header = Split(line);
    while (std::getline(lines, line)) rows.push_back(Split(line));
  }
  std::string Csv() const {
    std::string csv;
    const auto add = [&](const Row& row) {
      for (size_t c = 0; c < row.size(); ++c) csv += (c > 0 ? "," : "") + row[c];
      csv += '\n';
    };
    add(header);
    for (const Row& row : rows) add(row);
    return csv;
  }
  size_t Column(const std::string& name) const {
    const auto at = std::find(header.begin(), header.end(), name);
    if (at == header.end()) throw std::invalid_argument("the file has no column " + name);
    return at - header.begin();
  }
  // The columns t_..._us, first finger to last.
  std::vector<size_t> Times() const {
    std::vector<size_t> columns;
    for (size_t c = 0; c < header.size(); ++c)
      if (header[c].compare(0, 2, "t_") == 0) columns.push_back(c);
    return columns;
  }
  void Scale(const std::vector<size_t>& columns, double factor) {
    for (Row& row : rows)
      for (const size_t c : columns)
        if (!row[c].empty()) row[c] = Text(factor * std::atof(row[c].c_str()));
  }
  std::vector<size_t> Vector(const std::string& name, const std::string& unit = "") const {
    std::vector<size_t> columns;
    for (const char* axis : {"_x", "_y", "_z"}) columns.push_back(Column(name + axis + unit));
    return columns;
  }
};

void PermuteTimes(CsvTable* table, const std::vector<int>& from) {
  const std::vector<size_t> times = table->Times();
  for (Row& row : table->rows) {
    const Row old = row;
    for (size_t i = 0; i < times.size(); ++i) row[times[i]] = old[times[from[i]]];
  }
}

// In ascending order, as spreadsheets do it to one column; empty cells go last.
void SortTimes(CsvTable* table, int finger) {
  const size_t column = table->Times().at(finger);
  Row sorted;
  for (const Row& row : table->rows) sorted.push_back(row[column]);
  std::stable_sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) {
    return !a.empty() && (b.empty() || std::atof(a.c_str()) < std::atof(b.c_str()));
  });
  for (size_t k = 0; k < sorted.size(); ++k) table->rows[k][column] = sorted[k];
}

// The name of one object on another, and the other way round if the two are swapped.
void Rename(CsvTable* table, int one, int other, bool swapped) {
  const size_t column = table->Column("object");
  Row names;
  for (const Row& row : table->rows)
    if (std::count(names.begin(), names.end(), row[column]) == 0) names.push_back(row[column]);
  const std::string a = names.at(one), b = names.at(other);
  for (Row& row : table->rows)
    if (row[column] == a)
      row[column] = b;
    else if (swapped && row[column] == b)
      row[column] = a;
}

void TurnFrame(CsvTable* table, double deg) {
  const double c = std::cos(deg * M_PI / 180), s = std::sin(deg * M_PI / 180);
  for (const auto& columns :
       {table->Vector("target", "_mm"), table->Vector("approach"), table->Vector("lateral")})
    for (Row& row : table->rows) {
      const double y = std::atof(row[columns[1]].c_str()), z = std::atof(row[columns[2]].c_str());
      row[columns[1]] = Text(c * y - s * z);
      row[columns[2]] = Text(s * y + c * z);
    }
}

void ShiftTimes(CsvTable* table, int by) {
  const std::vector<size_t> times = table->Times();
  const auto old = table->rows;
  const int rows = old.size();
  for (int k = 0; k < rows; ++k)
    for (const size_t c : times) table->rows[k][c] = old[((k - by) % rows + rows) % rows][c];
}

// Rows evenly over the file, again at its end under new numbers.
void AddCopies(CsvTable* table, double share, int times) {
  const size_t touch = table->Column("touch"), rows = table->rows.size();
  for (int copy = 0; copy < times; ++copy)
    for (size_t k = 0; k < rows; ++k) {
      if (std::floor((k + 1) * share) == std::floor(k * share)) continue;
      Row row = table->rows[k];
      row[touch] = std::to_string(table->rows.size());
      table->rows.push_back(std::move(row));
    }
}

}  // namespace

std::string WithDataError(const std::string& csv, const DataError& data_error) {
  CsvTable table(csv);
  switch (data_error.kind) {
    case DataErrorKind::kLateralReversed:
      table.Scale(table.Vector("lateral"), -1);
      break;
    case DataErrorKind::kApproachReversed:
      table.Scale(table.Vector("approach"), -1);
      break;
    case DataErrorKind::kFingersPermuted:
      PermuteTimes(&table, data_error.which);
      break;
    case DataErrorKind::kColumnSorted:
      SortTimes(&table, data_error.which.at(0));
      break;
    case DataErrorKind::kObjectsSwapped:
    case DataErrorKind::kWrongObject:
      Rename(&table, data_error.which.at(0), data_error.which.at(1),
             data_error.kind == DataErrorKind::kObjectsSwapped);
      break;
    case DataErrorKind::kTimeUnits:
      table.Scale(table.Times(), data_error.number);
      break;
    case DataErrorKind::kLengthUnits:
      table.Scale(table.Vector("target", "_mm"), data_error.number);
      table.Scale({table.Column("standoff_mm")}, data_error.number);
      break;
    case DataErrorKind::kSpeedFactor:
      table.Scale({table.Column("speed_mm_s")}, data_error.number);
      break;
    case DataErrorKind::kObjectLower: {
      const size_t z = table.Column("target_z_mm");
      for (Row& row : table.rows) row[z] = Text(std::atof(row[z].c_str()) + data_error.number);
      break;
    }
    case DataErrorKind::kFrameTurned:
      TurnFrame(&table, data_error.number);
      break;
    case DataErrorKind::kRowsShifted:
      ShiftTimes(&table, data_error.which.at(0));
      break;
    case DataErrorKind::kCopies:
      AddCopies(&table, data_error.number, data_error.which.at(0));
      break;
  }
  return table.Csv();
}

std::vector<std::string> ProblemKinds(const DataError& data_error) {
  switch (data_error.kind) {
    case DataErrorKind::kLateralReversed:
      return {"lateral_reversed", "finger_order"};
    case DataErrorKind::kFingersPermuted:
      if (std::is_sorted(data_error.which.rbegin(), data_error.which.rend()))
        return {"finger_order", "lateral_reversed"};
      return {"finger_order"};
    case DataErrorKind::kApproachReversed:
      return {"approach_reversed"};
    case DataErrorKind::kObjectsSwapped:
    case DataErrorKind::kWrongObject:
      return {"object_names", "wrong_mesh"};
    case DataErrorKind::kTimeUnits:
    case DataErrorKind::kSpeedFactor:
      return {"units_time", "speed_factor"};
    case DataErrorKind::kLengthUnits:
      return {"units_length"};
    case DataErrorKind::kObjectLower:
      return {"object_origin"};
    case DataErrorKind::kFrameTurned:
      return {"frame"};
    case DataErrorKind::kColumnSorted:
    case DataErrorKind::kRowsShifted:
      return {"row_shift"};
    case DataErrorKind::kCopies:
      return {"duplicates"};
  }
  return {};
}

std::string InWords(const DataError& data_error) {
  static const char* const kNames[] = {"lateral reversed",
                                       "approach reversed",
                                       "fingers permuted",
                                       "column sorted",
                                       "objects swapped",
                                       "wrong object",
                                       "times scaled",
                                       "lengths scaled",
                                       "speeds scaled",
                                       "object lower",
                                       "frame turned",
                                       "rows shifted",
                                       "copies"};
  std::string words = kNames[static_cast<int>(data_error.kind)];
  if (data_error.number != 0) words += " " + Text(data_error.number);
  for (const int which : data_error.which) words += " " + std::to_string(which);
  return words;
}

}  // namespace touchstone::hidden
