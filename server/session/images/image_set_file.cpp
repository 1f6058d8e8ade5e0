#include "server/session/images/image_set_file.h"

#include <absl/container/flat_hash_map.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>

#include <filesystem>

#include "server/base/files/file_writer.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/image/encoding/encode.h"
#include "server/session/csv/csv_fields.h"
#include "server/session/images/camera_yaml.h"
#include "server/session/images/images_csv.h"

namespace touchstone::session {
namespace {

namespace fs = std::filesystem;

using PicturesByName = absl::flat_hash_map<absl::string_view, const std::string*>;

std::string PathIn(const std::string& folder, const std::string& file) {
  return (fs::path(folder) / file).string();
}

absl::Status WrongPicture(const ImageSet& set, const PhotographRow& row, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat(PathIn(set.origin, kImagesCsv), ":", row.line,
                                                 ": column file: '", Shown(row.file), "' ", what));
}

// images.csv with the name of its folder as origin.
absl::StatusOr<ImageSet> ParseRows(absl::string_view csv, const std::string& folder) {
  TOUCHSTONE_ASSIGN_OR_RETURN(ImageSet set, ParseImagesCsv(csv, PathIn(folder, kImagesCsv)));
  set.origin = folder;
  return set;
}

absl::Status TooLarge(const std::string& origin, const char* what) {
  return absl::InvalidArgumentError(absl::StrCat(origin, ": ", what, " of the image set come to more than ",
                                                 kMaxImageSetBytes >> 20,
                                                 " MiB; fewer or smaller pictures were expected"));
}

// The pictures of a message by name; each belongs to a row.
absl::StatusOr<PicturesByName> NamedPictures(const v1::ImageSetFiles& files, const ImageSet& rows) {
  PicturesByName named;
  uint64_t bytes = files.images_csv().size() + files.camera_yaml().size();
  for (const v1::ImageFile& file : files.files()) {
    if (!named.emplace(file.name(), &file.png()).second)
      return absl::InvalidArgumentError(
          absl::StrCat(rows.origin, ": two pictures are named '", Shown(file.name()), "'; one was expected"));
    if (file.png().size() > kMaxPictureBytes)
      return absl::InvalidArgumentError(absl::StrCat(rows.origin, ": picture '", Shown(file.name()), "' has ",
                                                     file.png().size(), " bytes; at most ", kMaxPictureBytes,
                                                     " are read"));
    bytes += file.png().size();
  }
  if (bytes > kMaxImageSetBytes) return TooLarge(rows.origin, "the files");
  for (const PhotographRow& row : rows.photographs)
    if (named.count(row.file) == 0)
      return WrongPicture(rows, row, "is not among the pictures; a PNG file was expected");
  if (named.size() == rows.size()) return named;
  absl::flat_hash_map<absl::string_view, int> in_rows;
  for (const PhotographRow& row : rows.photographs) in_rows[row.file] = row.line;
  for (const v1::ImageFile& file : files.files())
    if (in_rows.count(file.name()) == 0)
      return absl::InvalidArgumentError(absl::StrCat(
          rows.origin, ": picture '", Shown(file.name()),
          "' stands in no row of images.csv, so its pose is unknown; one ", "row per picture was expected"));
  return named;
}

// Before the first picture is decoded, so that a set that cannot be taken costs nothing.
absl::Status CheckPictureSizes(const PicturesByName& named, const ImageSet& set) {
  uint64_t pixel_bytes = 0;
  for (const PhotographRow& row : set.photographs) {
    const absl::StatusOr<image::PictureSize> size = image::PlainPngSize(*named.at(row.file));
    if (!size.ok()) return WrongPicture(set, row, absl::StrCat("cannot be read: ", size.status().message()));
    if (size->width != set.camera.width_px || size->height != set.camera.height_px)
      return WrongPicture(
          set, row,
          absl::StrCat("is ", size->width, " x ", size->height, " pixels; ", set.camera.width_px, " x ",
                       set.camera.height_px, ", as camera.yaml says, were expected"));
    pixel_bytes += size->bytes();
    if (pixel_bytes > kMaxImageSetBytes) return TooLarge(set.origin, "the pixels");
  }
  return absl::OkStatus();
}

absl::Status DecodePictures(const PicturesByName& named, ImageSet* set) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckPictureSizes(named, *set));
  for (PhotographRow& row : set->photographs) {
    absl::StatusOr<image::Image> picture = image::DecodePlainPng(*named.at(row.file));
    if (!picture.ok())
      return WrongPicture(*set, row, absl::StrCat("cannot be read: ", picture.status().message()));
    row.channels = picture->channels;
    row.pixels = std::move(picture->pixels);
  }
  return absl::OkStatus();
}

}  // namespace

bool IsImageSetFolder(const std::string& path) {
  std::error_code error;
  return fs::is_regular_file(fs::path(path) / kImagesCsv, error);
}

bool HasTouches(const std::string& folder) {
  std::error_code error;
  return fs::is_regular_file(fs::path(folder) / kTouchesCsv, error);
}

absl::StatusOr<v1::ImageSetFiles> ReadImageSetFiles(const std::string& folder) {
  v1::ImageSetFiles files;
  files.set_origin(folder);
  TOUCHSTONE_ASSIGN_OR_RETURN(*files.mutable_images_csv(),
                              ReadFile(PathIn(folder, kImagesCsv), kMaxImagesCsvBytes));
  TOUCHSTONE_ASSIGN_OR_RETURN(const ImageSet rows, ParseRows(files.images_csv(), folder));
  const std::string camera = PathIn(folder, kCameraYaml);
  absl::StatusOr<std::string> yaml = ReadFile(camera, kMaxImagesCsvBytes);
  if (!yaml.ok())
    return absl::Status(
        yaml.status().code(),
        absl::StrCat(yaml.status().message(),
                     "; an image set needs it: {width_px: .., height_px: .., fx_px: .., fy_px: .., ",
                     "cx_px: .., cy_px: ..}"));
  *files.mutable_camera_yaml() = *std::move(yaml);
  uint64_t bytes = files.images_csv().size() + files.camera_yaml().size();
  for (const PhotographRow& row : rows.photographs) {
    absl::StatusOr<std::string> png = ReadFile(PathIn(folder, row.file), kMaxPictureBytes);
    if (!png.ok()) return WrongPicture(rows, row, absl::StrCat("cannot be read: ", png.status().message()));
    bytes += png->size();
    if (bytes > kMaxImageSetBytes) return TooLarge(folder, "the files");
    v1::ImageFile* file = files.add_files();
    file->set_name(row.file);
    file->set_png(*std::move(png));
  }
  return files;
}

absl::StatusOr<ImageSet> ParseImageSet(const v1::ImageSetFiles& files) {
  const std::string origin = files.origin().empty() ? "images" : files.origin();
  if (files.images_csv().size() > kMaxImagesCsvBytes)
    return absl::InvalidArgumentError(absl::StrCat(PathIn(origin, kImagesCsv), ": has ",
                                                   files.images_csv().size(), " bytes; at most ",
                                                   kMaxImagesCsvBytes, " are read"));
  TOUCHSTONE_ASSIGN_OR_RETURN(ImageSet set, ParseRows(files.images_csv(), origin));
  TOUCHSTONE_ASSIGN_OR_RETURN(set.camera, ParseCameraYaml(files.camera_yaml(), PathIn(origin, kCameraYaml)));
  TOUCHSTONE_ASSIGN_OR_RETURN(const PicturesByName named, NamedPictures(files, set));
  TOUCHSTONE_RETURN_IF_ERROR(DecodePictures(named, &set));
  set.sha256 = ImageSetHash(set, files);
  return set;
}

uint64_t PixelBytes(const v1::ImageSetFiles& files) {
  uint64_t bytes = 0;
  for (const v1::ImageFile& file : files.files())
    if (const auto size = image::PlainPngSize(file.png()); size.ok()) bytes += size->bytes();
  return bytes;
}

absl::StatusOr<ImageSet> ReadImageSet(const std::string& folder) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::ImageSetFiles files, ReadImageSetFiles(folder));
  return ParseImageSet(files);
}

absl::StatusOr<v1::ImageSetFiles> FormatImageSet(const ImageSet& set) {
  v1::ImageSetFiles files;
  files.set_origin(set.origin);
  files.set_images_csv(FormatImagesCsv(set));
  files.set_camera_yaml(FormatCameraYaml(set.camera));
  const size_t pixels = static_cast<size_t>(set.camera.width_px) * set.camera.height_px;
  for (const PhotographRow& row : set.photographs) {
    if (row.pixels.size() != pixels * row.channels)
      return absl::InvalidArgumentError(absl::StrCat("photograph ", row.image, " has ", row.pixels.size(),
                                                     " bytes of pixels; ", pixels * row.channels,
                                                     " were expected"));
    v1::ImageFile* file = files.add_files();
    file->set_name(row.file);
    TOUCHSTONE_ASSIGN_OR_RETURN(*file->mutable_png(), image::EncodePng(row.pixels.data(), set.camera.width_px,
                                                                       set.camera.height_px, row.channels));
  }
  return files;
}

namespace {

absl::Status MakeFolder(const std::string& path) {
  std::error_code error;
  fs::create_directories(path, error);
  return error ? FileError(error.value(), path, "cannot be made") : absl::OkStatus();
}

// In the order in which they are written.
std::vector<std::string> NamesOf(const v1::ImageSetFiles& files,
                                 const std::map<std::string, std::string>& others) {
  std::vector<std::string> names;
  for (const v1::ImageFile& file : files.files()) names.push_back(file.name());
  names.emplace_back(kCameraYaml);
  for (const auto& [name, data] : others) names.push_back(name);
  names.emplace_back(kImagesCsv);
  return names;
}

absl::Status FillFolder(const v1::ImageSetFiles& files, const std::map<std::string, std::string>& others,
                        const std::string& folder) {
  const auto write = [&](const std::string& name, absl::string_view data) -> absl::Status {
    const std::string path = PathIn(folder, name);
    TOUCHSTONE_RETURN_IF_ERROR(MakeFolder(fs::path(path).parent_path().string()));
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto file, FileWriter::Create(path));
    TOUCHSTONE_RETURN_IF_ERROR(file->Write(data));
    return file->Close();
  };
  TOUCHSTONE_RETURN_IF_ERROR(MakeFolder(folder));
  for (const v1::ImageFile& file : files.files()) TOUCHSTONE_RETURN_IF_ERROR(write(file.name(), file.png()));
  TOUCHSTONE_RETURN_IF_ERROR(write(kCameraYaml, files.camera_yaml()));
  for (const auto& [name, data] : others) TOUCHSTONE_RETURN_IF_ERROR(write(name, data));
  TOUCHSTONE_RETURN_IF_ERROR(write(kImagesCsv, files.images_csv()));
  return SyncPath(folder);
}

// Whole files of these names, into a folder that has others.
absl::Status MoveFiles(const std::vector<std::string>& names, const std::string& from,
                       const std::string& to) {
  for (const std::string& name : names) {
    const std::string path = PathIn(to, name);
    TOUCHSTONE_RETURN_IF_ERROR(MakeFolder(fs::path(path).parent_path().string()));
    TOUCHSTONE_RETURN_IF_ERROR(RenameSynced(PathIn(from, name), path));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status WriteImageSetFiles(const v1::ImageSetFiles& files, const std::string& folder,
                                const std::map<std::string, std::string>& others) {
  if (IsImageSetFolder(folder))
    return absl::AlreadyExistsError(
        absl::StrCat(PathIn(folder, kImagesCsv), " exists already; a new folder was expected"));
  for (const v1::ImageFile& file : files.files())
    // The names may come from another machine.
    if (absl::Status status = CheckPictureName(file.name()); !status.ok())
      return absl::InvalidArgumentError(absl::StrCat(folder, ": picture ", status.message()));
  // "photos/" is photos.
  const std::string place = (fs::path(folder) / "").parent_path().string();
  std::error_code error;
  const bool is_there = fs::is_directory(place, error);
  const std::string part = UnfinishedPathOf(is_there ? PathIn(place, "set") : place);
  absl::Status status = FillFolder(files, others, part);
  if (status.ok())
    status = is_there ? MoveFiles(NamesOf(files, others), part, place) : RenameSynced(part, place);
  fs::remove_all(part, error);
  // What was asked for is named, and not the folder that takes its place.
  return absl::Status(status.code(), absl::StrReplaceAll(status.message(), {{part, place}}));
}

absl::Status WriteImageSet(const ImageSet& set, const std::string& folder) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::ImageSetFiles files, FormatImageSet(set));
  return WriteImageSetFiles(files, folder);
}

std::string ImageSetHash(const ImageSet& rows, const v1::ImageSetFiles& files) {
  absl::flat_hash_map<absl::string_view, const std::string*> named;
  for (const v1::ImageFile& file : files.files()) named[file.name()] = &file.png();
  std::string lines = absl::StrCat(Sha256Hex(files.images_csv()), "  ", kImagesCsv, "\n",
                                   Sha256Hex(files.camera_yaml()), "  ", kCameraYaml, "\n");
  for (const PhotographRow& row : rows.photographs)
    absl::StrAppend(&lines, Sha256Hex(*named.at(row.file)), "  ", row.file, "\n");
  return Sha256Hex(lines);
}

}  // namespace touchstone::session
