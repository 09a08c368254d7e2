-- Numbers figures, tables and equations by chapter ("Figure 2.3") and turns @fig:x, @tbl:x, @eq:x and @sec:x into
-- links, the same for the PDF and the HTML. A reference to nothing stops the build.

local kinds = {
  fig = "Figure",
  tbl = "Table",
  eq = "Equation",
  sec = "Section",
}
local chapter, counts, sections = 0, {}, {}
local numbers = {} -- identifier -> number as text
local is_typst = FORMAT:match("typst") ~= nil

local function kind_of(identifier)
  local kind = identifier:match("^(%a+):")
  return kinds[kind] and kind or nil
end

local function assign(identifier, kind)
  counts[kind] = (counts[kind] or 0) + 1
  if identifier ~= "" and numbers[identifier] then
    error("report: two things are called " .. identifier .. ".")
  end
  local number = chapter .. "." .. counts[kind]
  numbers[identifier] = number
  return number
end

local function with_number(word, number, inlines)
  local label = pandoc.Strong({ pandoc.Str(word .. "\u{a0}" .. number .. ".") })
  local out = pandoc.Inlines({ label, pandoc.Space() })
  out:extend(inlines)
  return out
end

local function number_caption(element, word, number)
  local long = element.caption.long
  if #long == 0 then
    long = pandoc.Blocks({ pandoc.Plain({}) })
  end
  long[1].content = with_number(word, number, long[1].content)
  element.caption.long = long
  return element
end

local function numbered_equation(span, number)
  if is_typst then
    local math = pandoc.write(pandoc.Pandoc({ pandoc.Para(span.content) }), "typst")
    return pandoc.RawBlock(
      "typst",
      "#[\n#set math.equation(numbering: _ => [(" .. number .. ")])\n"
        .. math:gsub("%s+$", "") .. " <" .. span.identifier .. ">\n]"
    )
  end
  local shown = pandoc.Span(span.content, { class = "formula" })
  local tag = pandoc.Span({ pandoc.Str("(" .. number .. ")") }, { class = "number" })
  return pandoc.Div({ pandoc.Plain({ shown, tag }) }, { id = span.identifier, class = "equation" })
end

-- First walk, in reading order: count and number.
local count = {
  traverse = "topdown",
  Header = function(header)
    if header.classes:includes("unnumbered") then
      return nil
    end
    for level = header.level + 1, 6 do
      sections[level] = 0
    end
    sections[header.level] = (sections[header.level] or 0) + 1
    if header.level == 1 then
      chapter = sections[1]
      counts = {}
    end
    local parts = {}
    for level = 1, header.level do
      parts[level] = tostring(sections[level] or 0)
    end
    numbers[header.identifier] = table.concat(parts, ".")
    return nil
  end,
  Figure = function(figure)
    return number_caption(figure, "Figure", assign(figure.identifier, "fig")), false
  end,
  Table = function(element)
    return number_caption(element, "Table", assign(element.identifier, "tbl")), false
  end,
  Para = function(paragraph)
    local span = paragraph.content[1]
    if #paragraph.content == 1 and span.t == "Span" and kind_of(span.identifier) == "eq" then
      return numbered_equation(span, assign(span.identifier, "eq")), false
    end
    return nil
  end,
}

-- Second walk: references, and paths of images as typst wants them.
local resolve = {
  Cite = function(cite)
    local out = pandoc.Inlines({})
    for position, citation in ipairs(cite.citations) do
      local kind = kind_of(citation.id)
      if not kind then
        return nil
      end
      local number = numbers[citation.id]
      if not number then
        error("report: there is nothing called " .. citation.id .. " to refer to.")
      end
      if position > 1 then
        out:insert(pandoc.Str(position == #cite.citations and " and " or ", "))
      end
      local word = (kind == "sec" and not number:find("%.")) and "Chapter" or kinds[kind]
      out:insert(pandoc.Link({ pandoc.Str(word .. "\u{a0}" .. number) }, "#" .. citation.id))
    end
    return out
  end,
  Image = function(image)
    if is_typst and not image.src:match("^/") then
      image.src = "/" .. image.src
    end
    return image
  end,
}

function Pandoc(document)
  return document:walk(count):walk(resolve)
end
