#include "server/service/sessions/stored_session.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/strip.h>

#include <set>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/session/csv/csv_fields.h"
#include "server/session/images/image_set_file.h"
#include "server/session/images/images_csv.h"
#include "server/session/measurements/measurement_set.h"

namespace touchstone::service {
namespace {

constexpr absl::string_view kImageSetMark = "touchstone: image-set/1\n";

absl::Status IsAPlan(const std::string& origin) {
  return absl::InvalidArgumentError(
      absl::StrCat(origin, ":1: has no column t_*_us: it is a plan; a session holds what was measured"));
}

absl::Status DescribeTouches(absl::string_view csv, const std::string& origin,
                             const session::MeasurementLimits& limits, v1::Session* session,
                             session::MeasurementSet* set) {
  TOUCHSTONE_ASSIGN_OR_RETURN(*set, session::ParseMeasurementSet(csv, origin, limits));
  if (set->fingers == 0) return IsAPlan(origin);
  session->set_touches(set->size());
  session->set_fingers(set->fingers);
  for (const std::string& object : set->objects) session->add_objects(object);
  session->set_has_poses(set->has_poses);
  return absl::OkStatus();
}

// A photograph may name the touch that it was taken with.
absl::Status CheckTouchesOfImages(const session::ImageSet& images, const session::MeasurementSet& touches) {
  const std::set<uint64_t> known(touches.touch.begin(), touches.touch.end());
  for (const session::PhotographRow& row : images.photographs)
    if (row.touch && known.count(*row.touch) == 0)
      return absl::InvalidArgumentError(
          absl::StrCat(images.origin, "/", session::kImagesCsv, ":", row.line, ": column touch: ", *row.touch,
                       " is no touch of ", session::kTouchesCsv, "; one of those was expected, or nothing"));
  return absl::OkStatus();
}

}  // namespace

bool HoldsImages(absl::string_view bytes) {
  return absl::StartsWith(bytes, kImageSetMark);
}

std::string PackSession(const StoredSession& session) {
  if (!session.images) return session.csv;
  v1::ImageSetFiles files = *session.images;
  files.clear_origin();
  if (!session.csv.empty()) {
    v1::ImageFile* touches = files.add_files();
    touches->set_name(session::kTouchesCsv);
    touches->set_png(session.csv);
  }
  std::string bytes(kImageSetMark);
  files.AppendToString(&bytes);
  return bytes;
}

absl::StatusOr<StoredSession> UnpackSession(absl::string_view bytes) {
  StoredSession session;
  if (!absl::ConsumePrefix(&bytes, kImageSetMark)) {
    session.csv = std::string(bytes);
    return session;
  }
  session.images.emplace();
  if (bytes.size() > INT32_MAX ||
      !session.images->ParseFromArray(bytes.data(), static_cast<int>(bytes.size())))
    return absl::DataLossError("the stored image set is damaged");
  auto* files = session.images->mutable_files();
  if (!files->empty() && files->rbegin()->name() == session::kTouchesCsv) {
    session.csv = std::move(*files->rbegin()->mutable_png());
    files->RemoveLast();
  }
  return session;
}

absl::StatusOr<v1::Session> DescribeSession(const std::string& name, absl::string_view bytes,
                                            const std::string& origin,
                                            const session::MeasurementLimits& limits) {
  v1::Session session;
  session.set_name(name);
  session::MeasurementSet touches;
  if (!HoldsImages(bytes)) {
    TOUCHSTONE_RETURN_IF_ERROR(DescribeTouches(bytes, origin, limits, &session, &touches));
    session.set_hash(Sha256Hex(bytes));
    session.set_bytes(bytes.size());
    return session;
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(StoredSession stored, UnpackSession(bytes));
  stored.images->set_origin(origin);
  TOUCHSTONE_ASSIGN_OR_RETURN(const session::ImageSet images, session::ParseImageSet(*stored.images));
  session.set_images(images.size());
  session.set_hash(images.sha256);
  session.set_has_poses(true);
  uint64_t size =
      stored.images->images_csv().size() + stored.images->camera_yaml().size() + stored.csv.size();
  for (const v1::ImageFile& file : stored.images->files()) size += file.png().size();
  session.set_bytes(size);
  if (!stored.csv.empty()) {
    TOUCHSTONE_RETURN_IF_ERROR(DescribeTouches(stored.csv, absl::StrCat(origin, "/", session::kTouchesCsv),
                                               limits, &session, &touches));
    TOUCHSTONE_RETURN_IF_ERROR(CheckTouchesOfImages(images, touches));
    session.set_hash(Sha256Hex(
        absl::StrCat(images.sha256, "  images\n", Sha256Hex(stored.csv), "  ", session::kTouchesCsv, "\n")));
  }
  const std::set<std::string> touched(session.objects().begin(), session.objects().end());
  for (const std::string& object : images.objects)
    if (touched.count(object) == 0) session.add_objects(object);
  return session;
}

absl::Status SessionPieces::Append(const std::string& file, absl::string_view piece) {
  bytes_ += piece.size();
  if (any_ && file == current_file_) {
    current_->append(piece.data(), piece.size());
    return absl::OkStatus();
  }
  if (any_ && file.empty() != current_file_.empty())
    return absl::InvalidArgumentError(absl::StrCat(
        "file = '", session::Shown(file), "' follows '", session::Shown(current_file_),
        "': a session is one measurement file (no file) or the files of an image set; its touches are ",
        session::kTouchesCsv));
  any_ = true;
  current_file_ = file;
  const auto again = [&] {
    return absl::InvalidArgumentError(
        absl::StrCat("file = '", session::Shown(file),
                     "' comes a second time; each file was expected once, whole, before ", "the next one"));
  };
  if (file.empty()) {
    current_ = &session_.csv;
  } else {
    if (!session_.images) session_.images.emplace();
    if (file == session::kImagesCsv) {
      current_ = session_.images->mutable_images_csv();
      if (!current_->empty()) return again();
    } else if (file == session::kCameraYaml) {
      current_ = session_.images->mutable_camera_yaml();
      if (!current_->empty()) return again();
    } else if (file == session::kTouchesCsv) {
      if (has_touches_) return again();
      has_touches_ = true;
      current_ = &session_.csv;
    } else {
      if (absl::Status status = session::CheckPictureName(file); !status.ok())
        return absl::InvalidArgumentError(absl::StrCat("file = ", status.message()));
      if (session_.images->files_size() >= static_cast<int>(session::kMaxPhotographs))
        return absl::InvalidArgumentError(
            absl::StrCat("file: at most ", session::kMaxPhotographs, " photographs are taken"));
      v1::ImageFile* picture = session_.images->add_files();
      picture->set_name(file);
      current_ = picture->mutable_png();
    }
  }
  current_->append(piece.data(), piece.size());
  return absl::OkStatus();
}

uint64_t SessionPieces::PixelBytes() const {
  return session_.images ? session::PixelBytes(*session_.images) : 0;
}

absl::StatusOr<std::string> SessionPieces::Take() {
  current_ = nullptr;
  any_ = false;
  if (has_touches_ && session_.csv.empty())
    return absl::InvalidArgumentError(
        absl::StrCat(session::kTouchesCsv, " is empty; a measurement file was expected"));
  if (!session_.images) return std::move(session_.csv);
  if (session_.images->images_csv().empty())
    return absl::InvalidArgumentError(absl::StrCat("the image set has no ", session::kImagesCsv,
                                                   "; it says from where each picture was taken"));
  return PackSession(std::exchange(session_, {}));
}

absl::Status ForEachPiece(absl::string_view bytes, size_t piece_bytes,
                          const std::function<bool(const std::string& file, absl::string_view piece)>& take) {
  const auto whole = [&](const std::string& file, absl::string_view content) {
    for (size_t begin = 0; begin < content.size(); begin += piece_bytes)
      if (!take(file, content.substr(begin, piece_bytes))) return false;
    return true;
  };
  if (!HoldsImages(bytes)) {
    whole("", bytes);
    return absl::OkStatus();
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const StoredSession session, UnpackSession(bytes));
  if (!whole(session::kImagesCsv, session.images->images_csv()) ||
      !whole(session::kCameraYaml, session.images->camera_yaml()) ||
      !whole(session::kTouchesCsv, session.csv))
    return absl::OkStatus();
  for (const v1::ImageFile& file : session.images->files())
    if (!whole(file.name(), file.png())) break;
  return absl::OkStatus();
}

}  // namespace touchstone::service
