-- The dissector that `udt export --to lua` writes, in parts; a part begins with three dashes and its name.
-- "begin" and "end" are always written, $words filled in; a reader only where a type needs it, with those
-- that it calls, whose names stand behind its own. A value is shown as `udt decode` shows it.
-- Lua 5.2 and 5.4: no `//`, no bit operators; 64 bits are split into days and nanoseconds before a double
-- touches them.

--- begin
-- $name: $form. Wireshark: $where; tshark: -X lua_script:FILE
local LITTLE, SIZE = $little, $size
local TITLE, FILTER = $title, $filter
local proto = Proto(FILTER, $about)
local types, values, fields = {}, {}, {}

local function field(kind, path, name, ...)
  local made = ProtoField[kind](path, name, ...)
  fields[#fields + 1] = made
  return made
end

-- A node is {at, size, name, ...}; offsets are relative to the node around it.
local function leaf(at, size, name, shown, read)
  return { at = at, size = size, name = name, field = shown, read = read }
end

local function branch(at, size, name, members)
  return { at = at, size = size, name = name, members = members }
end

-- bounds: {low, high} for each index; pitch: bytes from one element to the next
local function list(at, size, name, bounds, pitch, element)
  return { at = at, size = size, name = name, bounds = bounds, pitch = pitch, element = element }
end

local function masks(path, name, count)
  local made = {}
  for bit = 1, count do made[bit] = field("bool", path, name, 8, nil, 2 ^ (bit - 1)) end
  return made
end

-- Rows of bits, each row in bytes of its own; masked: one field for each bit of a byte.
local function bit_list(at, size, name, bounds, row_size, masked)
  return { at = at, size = size, name = name, bounds = bounds, row_size = row_size, masked = masked }
end

local function indices(bounds, number)
  local text = {}
  for place = #bounds, 1, -1 do
    local low, count = bounds[place][1], bounds[place][2] - bounds[place][1] + 1
    text[place] = string.format("%d", low + number % count)
    number = math.floor(number / count)
  end
  return "[" .. table.concat(text, ",") .. "]"
end

local function elements(bounds)
  local count = 1
  for _, pair in ipairs(bounds) do count = count * (pair[2] - pair[1] + 1) end
  return count
end

local show

local function show_bits(tree, data, node, start)
  local last = node.bounds[#node.bounds]
  local columns = last[2] - last[1] + 1
  for number = 0, elements(node.bounds) - 1 do
    local column = number % columns
    local at = start + math.floor(number / columns) * node.row_size + math.floor(column / 8)
    tree:add(node.masked[column % 8 + 1], data(at, 1)):prepend_text(indices(node.bounds, number) .. " ")
  end
end

show = function(tree, data, node, start, index)
  local range = data(start, node.size)
  if node.field then
    local item
    if node.read then
      item = tree:add(node.field, range, node.read(range))
    elseif LITTLE then
      item = tree:add_le(node.field, range)
    else
      item = tree:add(node.field, range)
    end
    if index then item:prepend_text(index .. " ") end
    return
  end
  local below = node.name and tree:add(range, (index and index .. " " or "") .. node.name) or tree
  if node.members then
    for _, member in ipairs(node.members) do show(below, data, member, start + member.at) end
  elseif node.masked then
    show_bits(below, data, node, start)
  else
    for number = 0, elements(node.bounds) - 1 do
      show(below, data, node.element, start + number * node.pitch, indices(node.bounds, number))
    end
  end
end

--- uint
local function uint(range)
  return LITTLE and range:le_uint() or range:uint()
end

--- hex_text
local function hex_text(range)
  return "16#" .. string.upper(tostring(range:bytes()))
end

--- latin1
-- Latin-1 to UTF-8; TvbRange:string() cuts what grows by that.
local function latin1(range)
  local text = {}
  for at = 0, range:len() - 1 do
    local code = range(at, 1):uint()
    local high = code >= 128 and string.char(192 + math.floor(code / 64)) or ""
    text[#text + 1] = high .. string.char(code >= 128 and 128 + code % 64 or code)
  end
  return table.concat(text)
end

--- wide
local function wide(range)
  return LITTLE and range:le_ustring() or range:ustring()
end

--- as_utf8
local function as_utf8(range) return range:string(ENC_UTF_8) end

--- headed latin1
-- STRING as [longest][actual], then characters
local function headed(longest, read)
  return function(range)
    local actual = math.min(range(1, 1):uint(), longest)
    return actual > 0 and (read or latin1)(range(2, actual)) or ""
  end
end

--- headed_wide uint wide
-- WSTRING as [longest][actual], words, then characters
local function headed_wide(longest)
  return function(range)
    local actual = math.min(uint(range(2, 2)), longest)
    return actual > 0 and wide(range(4, 2 * actual)) or ""
  end
end

--- ended latin1
-- STRING that ends with a NUL or with its last character
local function ended(longest, read)
  return function(range)
    local count = 0
    while count < longest and range(count, 1):uint() ~= 0 do count = count + 1 end
    return count > 0 and (read or latin1)(range(0, count)) or ""
  end
end

--- ended_wide wide
local function ended_wide(longest)
  return function(range)
    local count = 0
    while count < longest and range(2 * count, 2):uint() ~= 0 do count = count + 1 end
    return count > 0 and wide(range(0, 2 * count)) or ""
  end
end

--- split
-- A count as whole days and nanoseconds, both with its sign; 64 bits hold nanoseconds.
local DAY = 86400e9

local function split(range, signed, unit)
  if range:len() == 8 then
    local count, day
    if signed then
      count, day = LITTLE and range:le_int64() or range:int64(), Int64(DAY)
    else
      count, day = LITTLE and range:le_uint64() or range:uint64(), UInt64(DAY)
    end
    return (count / day):tonumber(), (count % day):tonumber()
  end
  local count
  if signed then
    count = LITTLE and range:le_int() or range:int()
  else
    count = LITTLE and range:le_uint() or range:uint()
  end
  local rest = math.fmod(count, DAY / unit)
  return (count - rest) / (DAY / unit), rest * unit
end

--- duration_text
local UNITS = {
  { "h", 3600e9 }, { "m", 60e9 }, { "s", 1e9 }, { "ms", 1e6 }, { "us", 1e3 }, { "ns", 1 },
}

local function duration_text(prefix, days, ns)
  local text = (days < 0 or ns < 0) and "-" or ""
  days, ns = math.abs(days), math.abs(ns)
  local parts = days > 0 and string.format("%.0fd", days) or ""
  for _, unit in ipairs(UNITS) do
    local count = math.floor(ns / unit[2])
    ns = ns - count * unit[2]
    if count > 0 then parts = parts .. string.format("%.0f", count) .. unit[1] end
  end
  return prefix .. text .. (parts == "" and "0ms" or parts)
end

--- clock_text
local function clock_text(hours, ns)
  local hour = math.floor(ns / 3600e9)
  local minute, second = math.floor(ns / 60e9) % 60, math.floor(ns / 1e9) % 60
  local rest = ns % 1e9
  local text = string.format("%02.0f:%02.0f:%02.0f", hours + hour, minute, second)
  return rest > 0 and text .. (string.format(".%09.0f", rest):gsub("0+$", "")) or text
end

--- date_text
-- Days since 1970 to a date, counted from 1 March of year 0 in eras of 400 years.
local function date_text(days)
  local floor = math.floor
  days = days + 719468
  local era, day = floor(days / 146097), days % 146097
  local year = floor((day - floor(day / 1460) + floor(day / 36524) - floor(day / 146096)) / 365)
  day = day - (365 * year + floor(year / 4) - floor(year / 100))
  local month = floor((5 * day + 2) / 153)
  local date = day - floor((153 * month + 2) / 5) + 1
  month = month < 10 and month + 3 or month - 9
  year = era * 400 + year + (month <= 2 and 1 or 0)
  return string.format("%04.0f-%02.0f-%02.0f", year, month, date)
end

--- days_of date_text
-- Days since 1970 and whether there is such a date
local function days_of(year, month, date)
  if month < 1 or month > 12 then return nil end
  local floor = math.floor
  local shifted = year - (month <= 2 and 1 or 0)
  local era, rest = floor(shifted / 400), shifted % 400
  local day = floor((153 * (month > 2 and month - 3 or month + 9) + 2) / 5) + date - 1
  local days = era * 146097 + rest * 365 + floor(rest / 4) - floor(rest / 100) + day - 719468
  local same = string.format("%04.0f-%02.0f-%02.0f", year, month, date)
  return date_text(days) == same and days or nil
end

--- duration split duration_text
local function duration(prefix, signed, unit)
  return function(range) return duration_text(prefix, split(range, signed, unit)) end
end

--- clock split clock_text
local function clock(prefix, signed, unit)
  return function(range)
    local days, ns = split(range, signed, unit)
    return prefix .. clock_text(24 * days, ns)
  end
end

--- date split date_text duration_text
local function date(prefix, signed, unit, epoch)
  return function(range)
    local days, ns = split(range, signed, unit)
    if ns < 0 then days, ns = days - 1, ns + 86400e9 end
    local rest = ns > 0 and duration_text(" (and T#", 0, ns) .. ")" or ""
    return prefix .. date_text(days + epoch) .. rest
  end
end

--- date_clock split date_text clock_text
local function date_clock(prefix, signed, unit, epoch)
  return function(range)
    local days, ns = split(range, signed, unit)
    if ns < 0 then days, ns = days - 1, ns + DAY end
    return prefix .. date_text(days + epoch) .. "-" .. clock_text(0, ns)
  end
end

--- moment days_of clock_text
local function moment(prefix, year, month, date, hour, minute, second, ns)
  if hour > 23 or minute > 59 or second > 59 or ns >= 1e9 then return nil end
  local days = days_of(year, month, date)
  local since = ((hour * 60 + minute) * 60 + second) * 1e9 + ns
  return days and prefix .. date_text(days) .. "-" .. clock_text(0, since)
end

--- bcd hex_text moment
-- DATE_AND_TIME of an S7: two digits each, then three digits of milliseconds
local function bcd(range)
  local digits = tostring(range:bytes())
  local part = {}
  for at = 1, 11, 2 do part[#part + 1] = tonumber(digits:sub(at, at + 1)) end
  local ms = tonumber(digits:sub(13, 15))
  if #part < 6 or not ms or digits:sub(1, 15):find("%D") then return hex_text(range) end
  local year = part[1] + (part[1] >= 90 and 1900 or 2000)
  return moment("DT#", year, part[2], part[3], part[4], part[5], part[6], ms * 1e6) or hex_text(range)
end

--- dtl uint hex_text moment
local function dtl(range)
  local part = {}
  for at = 2, 7 do part[at] = range(at, 1):uint() end
  local year, ns = uint(range(0, 2)), uint(range(8, 4))
  return moment("DTL#", year, part[2], part[3], part[5], part[6], part[7], ns) or hex_text(range)
end

--- s5time uint duration_text
local function s5time(range)
  local word = uint(range)
  local digits = string.format("%04X", word)
  if digits:sub(2):find("%D") then return "16#" .. digits end
  local base, count = math.floor(word / 4096) % 4, tonumber(digits:sub(2))
  local is_plain = word < 16384 and (base == 0 or count > 99)
  local beside = is_plain and "" or " (16#" .. digits .. ")"
  return duration_text("S5T#", 0, count * 10 ^ (base + 1) * 1e6) .. beside
end

--- end
local root = $root
proto.fields = fields

local function dissect_frame(data, pinfo, tree)
  pinfo.cols.protocol = TITLE
  show(tree:add(proto, data(0, SIZE), TITLE), data, root, 0)
  return SIZE
end

-- One value is SIZE bytes, however TCP has cut them: Wireshark puts the segments together.
function proto.dissector(data, pinfo, tree)
  dissect_tcp_pdus(data, tree, SIZE, function() return SIZE end, dissect_frame)
  return data:len()
end

$register
