#include "server/service/calls/wire_count.h"

#include <google/protobuf/wire_format_lite.h>

#include <algorithm>
#include <array>
#include <memory>

namespace touchstone::service {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::internal::WireFormatLite;

constexpr int kMaxDepth = 100;  // that of protobuf's own parser

// What is looked up of a type once: a request may have millions of its messages.
struct Type {
  explicit Type(const Descriptor* of) : descriptor(of) {
    for (int k = 0; k < of->field_count(); ++k)
      if (of->field(k)->number() < kFields) fields[of->field(k)->number()] = of->field(k);
  }
  const FieldDescriptor* Field(int number) const {
    return number < kFields ? fields[number] : descriptor->FindFieldByNumber(number);
  }

  static constexpr int kFields = 64;
  const Descriptor* const descriptor;
  std::array<const FieldDescriptor*, kFields> fields{};
  std::array<Type*, kFields> types{};  // of fields that are messages, once they were met
  uint64_t messages = 0;
};

class Counter {
 public:
  Counter(google::protobuf::io::CodedInputStream* input, WireCount* count) : input_(*input), count_(*count) {}
  ~Counter() {
    for (const auto& [descriptor, type] : types_)
      if (type->messages > 0) count_.messages[descriptor] = type->messages;
  }

  Type* TypeOf(const Descriptor* descriptor) {
    std::unique_ptr<Type>& type = types_[descriptor];
    if (type == nullptr) type = std::make_unique<Type>(descriptor);
    return type.get();
  }

  // To the end of the input, of the limit that was pushed, or of the group that was begun. `type` null: unknown fields.
  bool Message(Type* type, int depth, uint32_t end_of_group = 0) {
    if (depth > kMaxDepth) return false;
    for (;;) {
      const uint32_t tag = input_.ReadTag();
      if (tag == 0) return end_of_group == 0 && input_.ConsumedEntireMessage();
      if (tag == end_of_group) return true;
      const int number = WireFormatLite::GetTagFieldNumber(tag);
      const FieldDescriptor* field = type == nullptr ? nullptr : type->Field(number);
      if (!Field(tag, type, field, depth)) return false;
    }
  }

 private:
  bool Field(uint32_t tag, Type* type, const FieldDescriptor* field, int depth) {
    switch (WireFormatLite::GetTagWireType(tag)) {
      case WireFormatLite::WIRETYPE_VARINT: {
        uint64_t value = 0;
        CountScalar(field);
        return input_.ReadVarint64(&value);
      }
      case WireFormatLite::WIRETYPE_FIXED64:
        CountScalar(field);
        return input_.Skip(8);
      case WireFormatLite::WIRETYPE_FIXED32:
        CountScalar(field);
        return input_.Skip(4);
      case WireFormatLite::WIRETYPE_LENGTH_DELIMITED:
        return Delimited(type, field, depth);
      case WireFormatLite::WIRETYPE_START_GROUP:
        ++count_.elements;
        return Message(nullptr, depth + 1,
                       WireFormatLite::MakeTag(WireFormatLite::GetTagFieldNumber(tag),
                                               WireFormatLite::WIRETYPE_END_GROUP));
      default:
        return false;
    }
  }

  Type* TypeOfField(Type* type, const FieldDescriptor& field) {
    if (field.number() >= Type::kFields) return TypeOf(field.message_type());
    Type*& found = type->types[field.number()];
    if (found == nullptr) found = TypeOf(field.message_type());
    return found;
  }

  void CountScalar(const FieldDescriptor* field) {
    if (field == nullptr)
      ++count_.elements;
    else if (field->is_repeated())
      ++count_.numbers;
  }

  bool Delimited(Type* type, const FieldDescriptor* field, int depth) {
    uint32_t length = 0;
    if (!input_.ReadVarint32(&length) || length > INT32_MAX) return false;
    const int bytes = static_cast<int>(length);
    if (field != nullptr && field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      ++count_.elements;
      Type* const of_field = TypeOfField(type, *field);
      ++of_field->messages;
      if (bytes == 0) return true;
      const auto limit = input_.PushLimit(bytes);
      if (!Message(of_field, depth + 1)) return false;
      if (input_.BytesUntilLimit() > 0) return false;
      input_.PopLimit(limit);
      return true;
    }
    if (field != nullptr && field->is_packable()) return Packed(*field, bytes);
    ++count_.elements;
    return input_.Skip(bytes);
  }

  bool Packed(const FieldDescriptor& field, int bytes) {
    switch (field.type()) {
      case FieldDescriptor::TYPE_DOUBLE:
      case FieldDescriptor::TYPE_FIXED64:
      case FieldDescriptor::TYPE_SFIXED64:
        count_.numbers += bytes / 8;
        return input_.Skip(bytes);
      case FieldDescriptor::TYPE_FLOAT:
      case FieldDescriptor::TYPE_FIXED32:
      case FieldDescriptor::TYPE_SFIXED32:
        count_.numbers += bytes / 4;
        return input_.Skip(bytes);
      default:
        break;
    }
    // Every number of a varint ends with a byte below 128.
    while (bytes > 0) {
      const void* piece = nullptr;
      int size = 0;
      if (!input_.GetDirectBufferPointer(&piece, &size)) return false;
      size = std::min(size, bytes);
      const auto* begin = static_cast<const uint8_t*>(piece);
      count_.numbers += std::count_if(begin, begin + size, [](uint8_t byte) { return byte < 0x80; });
      if (!input_.Skip(size)) return false;
      bytes -= size;
    }
    return true;
  }

  google::protobuf::io::CodedInputStream& input_;
  WireCount& count_;
  std::map<const Descriptor*, std::unique_ptr<Type>> types_;
};

}  // namespace

uint64_t WireCount::Messages(const std::string& type) const {
  for (const auto& [descriptor, number] : messages)
    if (descriptor->full_name() == type) return number;
  return 0;
}

bool CountWire(google::protobuf::io::CodedInputStream* input, const Descriptor* type, WireCount* count) {
  Counter counter(input, count);
  return counter.Message(counter.TypeOf(type), 0);
}

}  // namespace touchstone::service
